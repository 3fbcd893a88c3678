"""Compares models with recordings: replay, identification, discovery."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from slosh.arguments import measured_motions, the_model
from slosh_bag.reader import BagReader
from slosh_discovery.discover.finding import Finding
from slosh_discovery.discover.workflow import discover as discover_motions
from slosh_discovery.identify.parameters import DEFAULT
from slosh_discovery.identify.result import Identification
from slosh_discovery.identify.workflow import identify as identify_motions
from slosh_replay.replay.replay_bag import replay_bag
from slosh_replay.replay.result import ReplayResult

if TYPE_CHECKING:
    from slosh.arguments import DataLike, ModelLike, Several


def replay(
    recording: BagReader | str | os.PathLike[str], model: ModelLike | None = None
) -> ReplayResult:
    """Recomputes a recording's estimates and compares them with measured and recorded ones.

    >>> import slosh
    >>> slosh.replay("bags/c3")
    ReplayResult(c3: 553 images, 9.2 s, 3D-NL MAE 0.10 mm, 4 events, 4609 of 4609 bit for bit)

    Args:
        recording: a Recording or its path.
        model: to replay with, a Model or the path of a `model.yaml`; None: the recorded one.

    Raises:
        TypeError: an argument is of another kind.
        SloshModelError, SloshBagError: an impossible model or recording.
    """
    path = recording.path if isinstance(recording, BagReader) else recording
    if not isinstance(path, str | os.PathLike):
        raise TypeError(f"recording = {path!r:.60}: must be a Recording or the path of a bag")
    return replay_bag(Path(path), None if model is None else the_model(model))


def identify(
    data: DataLike | Several[DataLike],
    model: ModelLike,
    names: Sequence[str] = DEFAULT,
    *,
    holdout: DataLike | Several[DataLike] = (),
) -> Identification:
    """Identifies a model's parameters from measured motions.

    >>> import slosh
    >>> slosh.identify("bags/c3", slosh.replay("bags/c3").model)
    Identification(natural_frequency 18.96 ± 0.08 rad/s, damping_ratio 0.006205 ± 0.004,
        f 3.017 Hz, rms 0.24 mm, 1 motion)

    Args:
        data: Recordings, Motions with heights, pandas tables or paths of these; one or a list.
        model: a Model or the path of a `model.yaml`; what is not fitted stays as it has it.
        names: parameters to fit.
        holdout: as data; motions that the fit does not see.

    Raises:
        TypeError: an argument is of another kind.
        SloshModelError, SloshBagError, SloshDiscoveryError: an impossible model or data.
    """
    base = the_model(model)
    fit, unseen = measured_motions(data, base), measured_motions(holdout, base, "holdout")
    return identify_motions(fit, base, names, holdout=unseen)


def discover(
    data: DataLike | Several[DataLike],
    model: ModelLike,
    *,
    holdout: DataLike | Several[DataLike] = (),
) -> Finding:
    """Finds the physical effect that a model lacks to explain measured motions.

    >>> import slosh
    >>> slosh.discover("bags/c3", slosh.replay("bags/c3").model.linear())
    Finding(named surface_nonlinearity (0.91), rms 2.21 → 0.16 mm, 1 motion)

    Args:
        data: Recordings, Motions with heights, pandas tables or paths of these; one or a list.
        model: a Model or the path of a `model.yaml`.
        holdout: as data; motions that the fit does not see show by how much the gap shrinks.

    Raises:
        TypeError: an argument is of another kind.
        SloshModelError, SloshBagError, SloshDiscoveryError: an impossible model or data.
    """
    base = the_model(model)
    fit, unseen = measured_motions(data, base), measured_motions(holdout, base, "holdout")
    return discover_motions(fit, base, unseen)
