"""Data types of the Python interface: containers, models, motions and recordings."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Self

from numpy.typing import ArrayLike

from slosh_bag.interchange.export import export_targets, export_topics
from slosh_bag.reader import BagReader
from slosh_model.containers import Container
from slosh_model.for_notebooks import height_axes, needed
from slosh_model.model import Model
from slosh_model.simulate import Inputs
from slosh_motion.tables.motion_table import MotionTable, read_motion_table, write_motion_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

__all__ = ["Container", "Model", "Motion", "Recording"]


class Motion(MotionTable):
    """A container's motion, with measured liquid heights if there are any.

    Args:
        t: (N,) time [s], strictly increasing.
        acceleration: (N, 3) of the container's origin, world frame, gravity excluded [m/s²].
        attitude: (N, 4) quaternion x, y, z, w, world ← container; None: upright.
        angular_velocity: (N, 3) in the container's frame [rad/s]; None: not given.
        measured: heights, as `slosh_bag.MotionTable` has them.

    Raises:
        SloshModelError: shapes that do not match, a value that is not finite, or time that does
            not increase.

    >>> import numpy as np, slosh
    >>> t = np.linspace(0.0, 1.0, 1001)  # s
    >>> slosh.Motion(t, np.outer(np.sin(9.0 * t), [1.0, 0.0, 0.0]))  # m/s²
    Motion(1001 samples, 0 … 1 s, acceleration up to 1 m/s²)
    """

    __slots__ = ()

    def __init__(
        self,
        t: ArrayLike,
        acceleration: ArrayLike,
        attitude: ArrayLike | None = None,
        angular_velocity: ArrayLike | None = None,
        **measured: Any,
    ) -> None:
        given = Inputs(t, acceleration, attitude, angular_velocity)  # type: ignore[arg-type]
        super().__init__(
            given.t, given.acceleration, given.attitude, given.angular_velocity, **measured
        )

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Reads a motion from a table file."""
        table = read_motion_table(path)
        return cls(**{name: getattr(table, name) for name in MotionTable.__dataclass_fields__})

    def save(self, path: str | Path) -> None:
        """Writes the motion as a table file, without loss of precision.

        Raises:
            OSError: the file cannot be written; what was there is as it was.
        """
        write_motion_table(path, self)

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draws the accelerations along x, y and z [m/s²] over time [s].

        Args:
            axes: matplotlib's; None: of a new figure.
        """
        axes = height_axes(axes)
        axes.set_ylabel("acceleration [m/s²]")
        axes.plot(self.t, self.acceleration, label=["x", "y", "z"])
        axes.legend()
        return axes


class Recording(BagReader):
    """A recording: a bag folder or an MCAP file.

    >>> import slosh
    >>> recording = slosh.Recording("bags/c3")
    >>> recording
    Recording(c3: 18 topics, 13265 messages)
    >>> print(recording.to_pandas("free_surface")["msh"].max(), "m")
    0.0241433008975276 m
    """

    def __repr__(self) -> str:
        counts = [topic.count or 0 for topic in self.topics().values()]
        return f"Recording({self.path.name}: {len(counts)} topics, {sum(counts)} messages)"

    def to_pandas(self, topic: str) -> DataFrame:
        """Returns a topic's messages as a pandas table with one column per field.

        Args:
            topic: its name, or the last parts of it.

        Raises:
            SloshBagError: there is no such topic.
            ImportError: pandas or pyarrow is not installed.
        """
        pandas: Any = needed("pandas", "a table")
        with TemporaryDirectory() as folder:
            path = Path(folder) / "topic.parquet"
            export_topics(self, export_targets(self.path, self, [topic], path))
            return pandas.read_parquet(path)
