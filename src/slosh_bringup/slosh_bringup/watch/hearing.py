"""Passes the messages of a live or recorded cell to the state of its watch page."""

from __future__ import annotations

import contextlib
import importlib
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from slosh_base.addons import add_ons
from slosh_base.files.nanoseconds import SECOND
from slosh_bringup.watch.picture import Camera
from slosh_bringup.watch.state import (
    CalmNews,
    Compared,
    Estimated,
    Fused,
    LimitNews,
    Surface,
    WatchState,
)
from slosh_motion.recorded.settings import NodeStart, model_of

CAMERA, MODEL = "the camera", "the estimator"
Hear = Callable[[WatchState, Any, float], None]
"""Adds a message, received at a monotonic time [s], to the page's state."""


def hear_comparison(state: WatchState, message: Any, now: float) -> None:
    """Adds a SloshComparison, received at a monotonic time [s], to the watch page's state."""
    state.take_comparison(compared(message), now)


def compared(message: Any) -> Compared:
    """Returns the fields of a SloshComparison that the watch page displays."""
    silent = ((CAMERA, message.measured_stale), (MODEL, message.estimate_stale))
    return Compared(
        stamp_ns(message),
        message.measured,
        message.measured_stddev,
        message.estimated_nonlinear,
        message.residual_nonlinear,
        message.sigma_nonlinear,
        message.epsilon_nonlinear,
        message.state,
        tuple(name for name, stale in silent if stale),
        # Recordings of before know neither.
        getattr(message, "without_camera", False),
        getattr(message, "sides_disagree", False),
    )


def hear_surface(state: WatchState, message: Any) -> None:
    """Adds a FreeSurface message to the watch page's state."""
    state.take_surface(
        Surface(
            stamp_ns(message),
            message.msh,
            message.azimuth,
            message.profile_azimuth,
            message.profile_height,
            message.flags,
        )
    )


def hear_estimate(state: WatchState, message: Any, now: float) -> None:
    """Adds a SloshEstimate, received at a monotonic time [s], to the watch page's state."""
    highest = message.nonlinear
    state.take_estimate(Estimated(stamp_ns(message), highest.msh, highest.azimuth), now)


def hear_fused(state: WatchState, message: Any) -> None:
    """Adds a FusedEstimate message to the watch page's state."""
    state.take_fused(Fused(stamp_ns(message), message.msh, message.msh_stddev))


def hear_calm(state: WatchState, message: Any, now: float) -> None:
    """Adds a Calm message, received at a monotonic time [s], to the watch page's state."""
    state.take_calm(
        CalmNews(
            message.calm,
            message.reason,
            message.bound,
            message.tolerance,
            message.time_until_calm,
        ),
        now,
    )


def figures() -> Mapping[str, Hear]:
    """Returns what adds a message of an add-on's topic to the page's state, by the topic."""
    modules = {topic: module for one in add_ons() for topic, module in one.figures.items()}
    return {topic: _hear_figure(topic, module) for topic, module in modules.items()}


def _hear_figure(topic: str, module: str) -> Hear:
    make = importlib.import_module(module).figure
    return lambda state, message, now: state.take_figure(topic, make(message), now)


def hear_event(state: WatchState, message: Any) -> None:
    """Adds a LimitEvent message to the watch page's state."""
    state.take_event(
        LimitNews(
            stamp_ns(message),
            message.id,
            message.kind,
            message.source,
            message.peak if message.peak == message.peak else math.nan,
            message.description,
        )
    )


def hear_start(state: WatchState, camera: Camera, start: NodeStart) -> None:
    """Adds a node's settings to the watch page: height limits, container or camera calibration."""
    state.take_parameters(start.node, start.parameters, goes_on=bool(start.changed))
    if start.node == "estimator":
        # Whoever speaks on that topic may say anything.
        with contextlib.suppress(ValueError):
            state.take_container(model_of(start).container)
    if start.node == "camera":
        folder = Path(str(start.parameters.get("calibration", ""))).parent
        camera.take_calibration(start.files.get("calibration", ""), folder)


def stamp_ns(message: Any) -> int:
    """Returns the stamp in a message's header [ns]."""
    stamp = message.header.stamp
    return int(stamp.sec) * SECOND + int(stamp.nanosec)
