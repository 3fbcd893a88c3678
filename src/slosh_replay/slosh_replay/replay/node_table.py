"""The list of nodes that a replay runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slosh_estimator.observer.calm import CALM_FIELDS, CalmReason
from slosh_estimator.observer.states import TOLD_FIELDS
from slosh_estimator.validity import EstimateFlag
from slosh_msgs_py.topics import CALM, COMPARISON, ESTIMATE, FUSED_ESTIMATE, TRAY_ESTIMATE
from slosh_replay.recording.sources import CALM as CALM_TYPE
from slosh_replay.recording.sources import COMPARISON as COMPARISON_TYPE
from slosh_replay.recording.sources import ESTIMATE as ESTIMATE_TYPE
from slosh_replay.recording.sources import FUSED as FUSED_TYPE
from slosh_replay.recording.sources import SURFACE
from slosh_replay.recording.sources import TRAY as TRAY_TYPE
from slosh_replay.replay.monitor_feed import ReplayedMonitor
from slosh_replay.replay.nodes import NodeTopic, ReplayedNode
from slosh_replay.replay.replayed_estimator import SAMPLES, ReplayedEstimator
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
    modes: int = 1, containers: int = 0, cameras: Sequence[ReplayedNode] = ()
) -> tuple[ReplayedNode, ...]:
    """Returns the nodes; each one comes after those whose topics it reads.

    Args:
        modes: of the recorded estimates.
        containers: of a tray; 0: there is none.
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
        ReplayedNode(
            "observer",
            ReplayedObserver,
            inputs=(
                NodeTopic(SAMPLES, ""),
                *(NodeTopic(door, SURFACE, SURFACES) for door in DOORS),
            ),
            outputs=(
                NodeTopic(FUSED_ESTIMATE, FUSED_TYPE, (*TOLD_FIELDS, *modal)),
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


def _alone(estimates: Messages) -> Messages:
    """Clears flags that depend on other publishers, which a recording cannot reproduce."""
    flags = estimates.columns["flags"] & ~_UNRECORDED
    return estimates._replace(columns={**estimates.columns, "flags": flags})


def _heard(calm: Messages) -> Messages:
    """Removes messages that a node published by its own clock about a silent input."""
    return calm.rows(calm.columns["reason"] != CalmReason.STALE)
