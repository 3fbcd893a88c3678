"""Heights of the liquid from a force sensor under the container, or from level sensors."""
