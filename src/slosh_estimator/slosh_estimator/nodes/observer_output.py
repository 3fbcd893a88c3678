"""Connects the observer to ROS: measured heights in, fused states and calmness out."""

from __future__ import annotations

import math
import time
from array import array
from functools import partial
from typing import Any

import numpy as np
from rclpy.action import CancelResponse
from rclpy.task import Future
from std_msgs.msg import Bool

from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.observer.calm import CalmReason, CalmState, CalmWatch, calm_fields
from slosh_estimator.observer.observer import Observer
from slosh_estimator.observer.states import FusedState, ObserverState, Outcome, fused_fields
from slosh_estimator.observer.surface_heights import SurfaceHeights, wall_heights
from slosh_estimator.tuning import TUNING
from slosh_model.model import Model
from slosh_model.wall import Wall
from slosh_motion.inputs.sampling import Sample
from slosh_msgs.action import WaitUntilCalm
from slosh_msgs.msg import Calm, FreeSurface, FusedEstimate
from slosh_msgs.msg import ObserverState as ObserverStateMessage
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.guarded import GuardedNode
from slosh_msgs_py.stamps import to_nanoseconds

_FIELDS = SurfaceHeights._fields


class ObserverOutput:
    """Runs the observer of the estimator node and publishes its states.

    Args:
        node: whose.
        frame: the container's.
        tolerance: height of a calm wave [m].
        model: of the estimator.
    """

    def __init__(self, node: GuardedNode, frame: str, tolerance: float, model: Model) -> None:
        self._node = node
        self._fused = FusedEstimate()
        self._state = ObserverStateMessage()
        self._state_ns = -(2**62)
        self._state.header.frame_id = frame
        self._calm = Calm()
        self._fused.header.frame_id = self._calm.header.frame_id = frame
        self._watch = CalmWatch(tolerance)
        self._waits: list[_Wait] = []
        self._calm_slot, self._moving = -1, 0
        self._last_input = node.steady_ns()
        self.load(model)
        self._fused_out = node.create_publisher(
            FusedEstimate, topics.FUSED_ESTIMATE, qos.STREAM_OUT
        )
        self._state_out = node.create_publisher(
            ObserverStateMessage, topics.OBSERVER_STATE, qos.STREAM_OUT
        )
        self._calm_out = node.create_publisher(Calm, topics.CALM, qos.LATCHED_STREAM)
        self._bool_out = node.create_publisher(Bool, topics.IS_CALM, qos.LATCHED_STREAM)
        for name, sensed in ((topics.FREE_SURFACE, False), (topics.SENSED_SURFACE, True)):
            taker = partial(self._take, sensed=sensed)
            node.create_subscription(FreeSurface, name, taker, qos.STREAM_IN)
        self._timer = node.create_timer(TUNING.calm_silence, self._look)
        self._action = node.create_action_server(
            WaitUntilCalm, topics.WAIT_UNTIL_CALM, self._on_goal,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )  # fmt: skip

    def load(self, model: Model) -> None:
        """Restarts the observer with another model."""
        self.observer, self._wall = Observer(model), model.container.wall
        # What a sensor reads of such a model is not the height of the liquid.
        self.hears = not model.uses("reading")
        self._watch = CalmWatch(self._watch.tolerance)

    def set_tolerance(self, tolerance: float) -> None:
        """Sets the wave height [m] up to which the liquid counts as calm."""
        self._watch = CalmWatch(tolerance)

    def warning(self) -> str:
        """Returns a warning if the calmness tolerance would pass any wave as calm; else empty."""
        refusal = self._refusal(self._watch.tolerance, 0.0)
        return f"calm_tolerance: {refusal}" if refusal else ""

    def close(self) -> None:
        """Ends all action goals that wait until the liquid is calm."""
        for wait in self._waits:
            wait.done.set_result(None)
        self._action.destroy()

    def follow(self, sample: Sample, flags: int) -> None:
        """Advances the observer by one input sample, whose validity flags are `flags`."""
        state = self.observer.follow(sample, flags)
        if state is None:
            return
        self._last_input = self._node.steady_ns()
        fill_fused(self._fused, state, self.observer, self._wall)
        if not 0 <= state.stamp_ns - self._state_ns < TUNING.observer_state_ns:
            self._state_ns = state.stamp_ns
            fill_observer_state(self._state, self.observer.state())
            self._state_out.publish(self._state)
        self._fused_out.publish(self._fused)
        calm = self._watch.update(state)
        for wait in self._waits:
            wait.update(state)
        # By stamps alone, so that a replay from the middle of a run tells the same.
        if state.stamp_ns // TUNING.calm_ns != self._calm_slot:
            self._calm_slot = state.stamp_ns // TUNING.calm_ns
            fill_calm(self._calm, calm)
            self._moving = self._moving + 1 if calm.reason is CalmReason.MOVING else 0
            self._tell()

    def stands_at(self, topic: str) -> int | None:
        """Returns the stamp of what was published last on a topic with a state [ns]; None: none.

        In motion calm begins anew.
        """
        if topic == topics.CALM:
            again = self._moving > 1
            return to_nanoseconds(self._calm.header.stamp) if again else None
        return self.observer.newest_ns

    def take_up(self, message: ObserverStateMessage | Calm) -> None:
        """Restores a published state, as a replay does behind what its recording lacks.

        Raises:
            SloshEstimatorError: the state is one of another model or version.
        """
        if isinstance(message, Calm):
            return
        state = observer_state(message)
        self.observer.take_up(state)
        self._watch.begin(state.first_ns)
        self._state_ns, self._moving = state.stamp_ns, 0

    def facts(self) -> dict[str, Any]:
        """Returns counts of used and rejected heights for the diagnostics."""
        counts = self.observer.counts
        return {f"heights {outcome.value}": counts[outcome] for outcome in Outcome}

    def _take(self, message: FreeSurface, *, sensed: bool) -> None:
        if self.hears:
            stamp_ns = to_nanoseconds(message.header.stamp)
            heights = SurfaceHeights(*(getattr(message, name) for name in _FIELDS))
            self.observer.take(wall_heights(stamp_ns, heights), sensed=sensed)

    def _look(self) -> None:
        """Publishes the state STALE if the input has stopped."""
        if self._node.steady_ns() - self._last_input < TUNING.calm_silence * SECOND:
            return
        fill_stale(self._calm, self._watch.tolerance)
        self._tell()

    def _tell(self) -> None:
        self._calm_out.publish(self._calm)
        self._bool_out.publish(Bool(data=self._calm.calm))
        for wait in self._waits:
            wait.tell(self._calm)

    async def _on_goal(self, goal: Any) -> WaitUntilCalm.Result:
        request = goal.request
        refusal = self._refusal(request.tolerance, request.timeout)
        if refusal:
            goal.abort()
            return WaitUntilCalm.Result(message=refusal)
        wait = _Wait(goal, request.tolerance or self._watch.tolerance, request.timeout)
        self._waits.append(wait)
        try:
            await wait.done
        finally:
            self._waits.remove(wait)
        return wait.result()

    def _refusal(self, tolerance: float, timeout: float) -> str:
        """Returns why a calmness goal is invalid, in one line; empty if it is valid."""
        reach = max(self.observer.reaches)
        if not 0.0 <= tolerance < reach:
            return (
                f"tolerance = {tolerance:g} m must be from 0 (calm_tolerance) to less than the "
                f"container's {reach:g} m; is it in mm?"
            )
        if not timeout >= 0.0:
            return f"timeout = {timeout:g} s must not be negative; 0: none"
        return ""


class _Wait:
    """An action goal that waits until the liquid is calm."""

    def __init__(self, goal: Any, tolerance: float, timeout: float) -> None:
        self._goal, self._timeout = goal, timeout if timeout > 0.0 else math.inf
        self._watch = CalmWatch(tolerance)
        self._began = time.monotonic()
        self._state = Calm()
        self.done: Future = Future()

    def update(self, state: FusedState) -> None:
        """Updates the action's calmness from a fused state of the observer."""
        fill_calm(self._state, self._watch.update(state))

    def tell(self, told: Calm) -> None:
        """Sends feedback to the action client; ends the goal if calm, timed out or cancelled."""
        if told.reason == Calm.STALE:
            fill_stale(self._state, self._watch.tolerance)
        self._state.header.frame_id = told.header.frame_id
        self._goal.publish_feedback(WaitUntilCalm.Feedback(state=self._state))
        late = time.monotonic() - self._began > self._timeout
        if (self._state.calm or late or self._goal.is_cancel_requested) and not self.done.done():
            self.done.set_result(None)

    def result(self) -> WaitUntilCalm.Result:
        """Ends the action goal and returns its result message."""
        result, waited = WaitUntilCalm.Result(), time.monotonic() - self._began
        result.calm, result.waited, result.state = self._state.calm, waited, self._state
        if self._goal.is_cancel_requested:
            self._goal.canceled()
            result.message = "cancelled"
        elif result.calm:
            self._goal.succeed()
            result.message = f"calm after {waited:.1f} s"
        else:
            self._goal.abort()
            result.message = f"not calm after {waited:.1f} s: {words(self._state)}"
        return result


def words(state: Calm) -> str:
    """Describes in words why the liquid is not calm, or that it is."""
    return {
        Calm.MOVING: "the container moves",
        Calm.SETTLING: f"the wave reaches {1e3 * state.envelope:.1f} mm",
        Calm.UNSURE: f"the wave may reach {1e3 * state.bound:.1f} mm",
        Calm.STALE: "the estimator has no input",
    }.get(state.reason, "calm")


def fill_fused(message: FusedEstimate, state: FusedState, observer: Observer, wall: Wall) -> None:
    """Writes a fused state, with its distance to the rim, into a reused message."""
    stamp = message.header.stamp
    stamp.sec, stamp.nanosec = divmod(state.stamp_ns, SECOND)
    for name, value in fused_fields(state, observer.counts, observer.sensed).items():
        setattr(message, name, value)
    message.trusted = state.trusted
    message.distance_to_rim = float(wall.place(state.msh).distance_to_rim)
    modal = state.modal
    message.modal_position = array(
        "d", [q for n in range(0, len(modal), 4) for q in modal[n : n + 2]]
    )
    message.modal_velocity = array(
        "d", [q for n in range(0, len(modal), 4) for q in modal[n + 2 : n + 4]]
    )


def fill_observer_state(message: ObserverStateMessage, state: ObserverState) -> None:
    """Writes an observer's state into a reused message."""
    stamp = message.header.stamp
    stamp.sec, stamp.nanosec = divmod(state.stamp_ns, SECOND)
    message.first_stamp = state.first_ns
    message.corrected_stamp = -1 if state.corrected_ns is None else state.corrected_ns
    message.judged_stamp = -1 if state.judged_ns is None else state.judged_ns
    message.counts, message.rejected_in_turn = array("Q", state.counts), state.rejected
    message.anchored_at, message.sensed = state.anchored_at, state.sensed
    message.sensed_stamp = -1 if state.sensed_ns is None else state.sensed_ns
    for name in ("model", "parameters", "covariance", "changes", "past"):
        setattr(message, name, array("d", getattr(state, name).tobytes()))


def observer_state(message: ObserverStateMessage) -> ObserverState:
    """Returns the observer's state that a message holds."""
    known = (message.corrected_stamp, message.judged_stamp, message.sensed_stamp)
    corrected, judged, sensed = (None if stamp < 0 else stamp for stamp in known)
    return ObserverState(
        to_nanoseconds(message.header.stamp), message.first_stamp, corrected, judged,
        tuple(message.counts), message.rejected_in_turn, message.anchored_at,
        np.array(message.model), np.array(message.parameters), np.array(message.covariance),
        np.array(message.changes), np.array(message.past), message.sensed, sensed,
    )  # fmt: skip


def fill_stale(message: Calm, tolerance: float) -> None:
    """Writes calmness STALE (no input) and the tolerance [m] into a reused message."""
    message.calm, message.reason = False, int(CalmReason.STALE)
    message.tolerance = tolerance
    message.envelope = message.bound = message.time_until_calm = math.nan
    message.shortest_time = message.longest_time = math.nan


def fill_calm(message: Calm, state: CalmState) -> None:
    """Writes the calmness of the liquid into a reused message."""
    stamp = message.header.stamp
    stamp.sec, stamp.nanosec = divmod(state.stamp_ns, SECOND)
    for name, value in calm_fields(state).items():
        setattr(message, name, value)
