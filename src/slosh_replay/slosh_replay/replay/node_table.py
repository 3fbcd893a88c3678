"""The table of all nodes that a replay runs, with topics and tolerances."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slosh_estimator.observer.calm import CALM_FIELDS, CalmReason
from slosh_estimator.observer.states import FUSED_FIELDS
from slosh_estimator.validity import EstimateFlag
from slosh_msgs_py.topics import (
    CALM,
    COMPARISON,
    ESTIMATE,
    FORCE,
    FUSED_ESTIMATE,
    TRAY_ESTIMATE,
)
from slosh_replay.recording.sources import CALM as CALM_TYPE
from slosh_replay.recording.sources import COMPARISON as COMPARISON_TYPE
from slosh_replay.recording.sources import ESTIMATE as ESTIMATE_TYPE
from slosh_replay.recording.sources import FUSED as FUSED_TYPE
from slosh_replay.recording.sources import SURFACE, WRENCH
from slosh_replay.recording.sources import TRAY as TRAY_TYPE
from slosh_replay.replay.monitor_feed import ReplayedMonitor
from slosh_replay.replay.nodes import NodeTopic, ReplayedNode
from slosh_replay.replay.replayed_estimator import SAMPLES, ReplayedEstimator
from slosh_replay.replay.replayed_force import AXES, ReplayedForce
from slosh_replay.replay.replayed_observer import DOORS, SURFACES, ReplayedObserver
from slosh_replay.replay.verification import (
    COMPARED,
    ESTIMATED,
    Messages,
    estimate_fields,
    tray_fields,
    with_an_image,
)

_UNRECORDED = np.uint16(EstimateFlag.INPUT_CONTESTED | EstimateFlag.INPUT_CONTRADICTED)


def node_table(
    modes: int = 1,
    containers: int = 0,
    force_surface: str = "",
    cameras: Sequence[ReplayedNode] = (),
) -> tuple[ReplayedNode, ...]:
    """Returns the table of replayed nodes; each node comes after the nodes that it reads from.

    Args:
        modes: of the recorded estimates.
        containers: of a tray; 0: there is none.
        force_surface: topic of heights that a sensor node made of a force; empty: there are none.
        cameras: nodes of containers with cameras of their own.
    """
    estimate = ("samples_used", *estimate_fields(modes))
    # What a governor reads of it.
    modal = [f"modal_{kind}[{k}]" for kind in ("position", "velocity") for k in range(2 * modes)]
    tray = NodeTopic(TRAY_ESTIMATE, TRAY_TYPE, tray_fields(containers))
    return (
        ReplayedNode(
            "estimator",
            ReplayedEstimator,
            outputs=(
                NodeTopic(ESTIMATE, ESTIMATE_TYPE, estimate, known=_alone),
                *([tray] if containers else []),
            ),
        ),
        *([_force_node(force_surface)] if force_surface else []),
        ReplayedNode(
            "observer",
            ReplayedObserver,
            inputs=(
                NodeTopic(SAMPLES, ""),
                *(NodeTopic(door, SURFACE, SURFACES) for door in DOORS),
            ),
            outputs=(
                NodeTopic(
                    FUSED_ESTIMATE, FUSED_TYPE, (*FUSED_FIELDS, *modal), later={"sensed_taken": 0}
                ),
                NodeTopic(CALM, CALM_TYPE, CALM_FIELDS, known=_heard),
            ),
            needs_recorded=True,
        ),
        ReplayedNode(
            "monitor",
            ReplayedMonitor,
            outputs=(
                NodeTopic(
                    COMPARISON,
                    COMPARISON_TYPE,
                    ("measured_stale", *COMPARED),
                    can_lack=ESTIMATED,
                    known=with_an_image,
                ),
            ),
            # A live monitor has deadlines.
            tolerance=None,
        ),
        *cameras,
    )


def _force_node(surface: str) -> ReplayedNode:
    """Returns the table row of the sensor node, which computes heights from a force."""
    return ReplayedNode(
        "sensor",
        ReplayedForce,
        inputs=(NodeTopic(SAMPLES, ""), NodeTopic(FORCE, WRENCH, AXES)),
        outputs=(NodeTopic(surface, SURFACE, SURFACES, known=_waves),),
        # What came before the recording is in the sensor's zero.
        tolerance=None,
        needs_recorded=True,
    )


def _waves(surfaces: Messages) -> Messages:
    """Removes heights of level sensors, since they are not maxima over the wall."""
    return surfaces.rows(np.isfinite(surfaces.columns["msh"]))


def _alone(estimates: Messages) -> Messages:
    """Clears flags that depend on other publishers, which a recording cannot reproduce."""
    flags = estimates.columns["flags"] & ~_UNRECORDED
    return estimates._replace(columns={**estimates.columns, "flags": flags})


def _heard(calm: Messages) -> Messages:
    """Removes Calm messages that report a silent input, since they depend on the live clock."""
    return calm.rows(calm.columns["reason"] != CalmReason.STALE)
