"""What `slosh predict` shows of its answers."""
