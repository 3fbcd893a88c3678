"""Converts arguments of the Python interface (objects, pandas tables, paths).

A table is taken as the CSV file that it writes: the same names, units and checks hold for both.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from slosh_bag.reader import BagReader
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover_data import read_motions
from slosh_model.model import Model
from slosh_model.model_text import read_model
from slosh_model.simulate import Inputs
from slosh_motion.tables.motion_table import MotionTable, write_motion_table
from slosh_plan.trajectory import Trajectory

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from pandas import DataFrame

    ModelLike: TypeAlias = Model | str | os.PathLike[str]
    MotionLike: TypeAlias = MotionTable | Inputs | Trajectory | DataFrame | str | os.PathLike[str]
    PathLike: TypeAlias = ArrayLike | DataFrame | str | os.PathLike[str]
    DataLike: TypeAlias = (
        MeasuredMotion | BagReader | MotionTable | DataFrame | str | os.PathLike[str]
    )
    One = TypeVar("One")
    Several: TypeAlias = list[One] | tuple[One, ...]

_PATH = (str, os.PathLike)
_MOTION = "a Motion, a pandas table or the path of a motion table"


def the_model(value: ModelLike) -> Model:
    """Returns the model for an argument that is a model or the path of a model file.

    Raises:
        TypeError: it is neither a model nor a path.
    """
    if isinstance(value, Model):
        return value
    if not isinstance(value, _PATH):
        raise TypeError(f"model = {value!r:.60}: must be a Model or the path of a model.yaml")
    return read_model(os.fspath(value))


@contextmanager
def as_file(value: Any, argument: str, kinds: str = _MOTION) -> Iterator[Path]:
    """Yields the path of a file with the motion data; errors name the function argument.

    Raises:
        TypeError: it is neither a motion, nor a table, nor a path.
    """
    if isinstance(value, _PATH):
        yield Path(value)
        return
    if isinstance(value, Inputs | Trajectory):
        value = MotionTable(value.t, value.acceleration, value.attitude, value.angular_velocity)
    frame = value if hasattr(value, "to_csv") else None
    if frame is None and not isinstance(value, MotionTable):
        if not hasattr(value, "to_pandas"):
            raise TypeError(f"{argument} = {value!r:.60}: must be {kinds}")
        frame = value.to_pandas()
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{argument}.csv"
        if frame is None:
            write_motion_table(path, value)
        else:
            frame.to_csv(path, index=frame.index.name is not None)
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            try:
                yield path
            except Exception as error:
                error.args = (str(error).replace(str(path), argument), *error.args[1:])
                raise
        for one in told:
            text = str(one.message).replace(str(path), argument)
            warnings.warn(text, one.category, stacklevel=4)


def measured_motions(
    data: DataLike | Several[DataLike], model: Model, argument: str = "data"
) -> list[MeasuredMotion]:
    """Returns the measured motions of an argument that is one motion or a list of motions.

    Raises:
        TypeError: something of it is no data.
        SloshBagError, SloshDiscoveryError: a file or a table has no measured motion.
    """
    if isinstance(data, MeasuredMotion):
        return [data]
    if isinstance(data, list | tuple):
        return [
            motion
            for place, one in enumerate(data)
            for motion in measured_motions(one, model, f"{argument}[{place}]")
        ]
    kinds = "a Recording, a Motion, a pandas table, the path of one, or a list of these"
    if isinstance(data, BagReader):
        data = data.path
    with as_file(data, argument, kinds) as path:
        return read_motions(path, model, warnings.warn)
