"""Runs estimator and monitor over a bag, without DDS and independent of the clock.

Images are not touched. Each stream is taken in the order in which it was recorded, the streams are
merged in the order of their stamps, two seconds behind the newest input: as much as an image may
need to become a height. So a replay holds seconds of a recording in memory, however long that is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Integers
from slosh_motion.recorded.inputs import stamps_of
from slosh_motion.recorded.motion import StrayFilter
from slosh_motion.signals.motion_spans import MotionFinder
from slosh_msgs_py.topics import COMPARISON, ESTIMATE, TRAY_ESTIMATE
from slosh_replay.recording.heights import Measurements
from slosh_replay.recording.states import RecordedState
from slosh_replay.replay.model_set import ModelHeights, at_images
from slosh_replay.replay.monitor_feed import ReplayedMonitor
from slosh_replay.replay.replayed_estimator import ReplayedEstimator
from slosh_replay.replay.series import Series, chosen, joined
from slosh_replay.replay.setting import NO_MEASUREMENTS, Setting
from slosh_replay.replay.unrelated import Alignment, align
from slosh_replay.replay.verification import (
    Columns,
    Messages,
    Verifier,
    comparison_columns,
    joined_messages,
)

BEHIND_NS = 2_000_000_000
"""How long a measurement may come after its stamp and still take its place in the order. An input
that has been silent for so long, by the recorder's clock, holds nothing up."""
SET_BACKS = 3
"""Stamps that go back more often than this are no clock that is set back."""
KEPT_NS = 200_000_000
"""Estimates that are kept before the oldest that was released, to interpolate between."""
DRAWN_NS = 20_000_000
"""Without a camera estimates are drawn so often."""
AHEAD_NS = 10_000_000_000
"""An image that is so far ahead of the inputs that are recorded with it shows another time."""
BEHIND_LAST_NS = 100_000_000
"""A message may be recorded before the input that it is made of, so at a recording's end without
it: with stamps so far behind the last input it is not compared."""
AT_LAST = "behind the last recorded input"
MAXIMUM = 2**31 * SECOND - 1
"""The last moment that a stamp can tell [ns]."""


class ReplayStream:
    """A running replay, which merges the streams of a recording by stamp.

    Args:
        name: of the recording, for errors.
        setting: what estimator and monitor are made of.
        series: receives the images.
        verifiers: of recorded estimates, by the last name of their topic.
        unrelated: whether the measured heights have a clock of their own: then they are laid over
            the estimates when all is there.

    Attributes:
        estimator, monitor: the cores.
        alignment: of unrelated clocks; None: not yet, or the clocks are one.
        motions: those of the container so far.
        images: measurements so far.
    """

    def __init__(
        self,
        name: str,
        setting: Setting,
        series: Series,
        *,
        verifiers: Mapping[str, Verifier] | None = None,
        unrelated: bool = False,
    ) -> None:
        self.setting, self.series = setting, series
        self.verifiers = verifiers or {}
        self.unrelated = unrelated
        compared = (self.verifiers.get(name) for name in (ESTIMATE, TRAY_ESTIMATE))
        self.estimator = ReplayedEstimator(setting, *compared)
        self.monitor = ReplayedMonitor(setting)
        self._inputs: list[Messages] = []
        self.alignment: Alignment | None = None
        self.motions = MotionFinder()
        self.images = 0
        self._stray_images = 0
        self._filter = StrayFilter(self.estimator.longest_gap_ns)
        self._measured_until = -(2**62)
        self._name = name
        self._set_backs = 0  # of the inputs' stamps
        self._last_input = np.empty(0, dtype=np.int64)
        self._measured: list[Measurements] = []
        self._heights: ModelHeights | None = None
        self._released = -(2**62)
        self._newest = {"input": _Newest(), "measurement": _Newest()}

    @property
    def strays(self) -> Mapping[str, int]:
        """Number of inputs and images that were excluded for stamps out of sequence."""
        return {"inputs": self._filter.count, "images": self._stray_images}

    def add_input(self, columns: Columns, log_ns: int) -> None:
        """Adds recorded input messages, from which the models are driven.

        Args:
            columns: their fields, (N,) each.
            log_ns: when the last of them was recorded [ns].
        """
        self._take_in(*self._filter.add(stamps_of(columns), columns), log_ns)

    def _take_in(self, stamps: Integers, columns: Columns, log_ns: int) -> None:
        if not len(stamps):
            return
        self._set_backs += int((np.diff(stamps, prepend=self._last_input) < 0).sum())
        self._last_input = stamps[-1:]
        self._inputs.append(Messages(stamps, columns))
        self._note("input", stamps, log_ns)

    def add_recorded(self, name: str, columns: Columns) -> None:
        """Adds recorded estimates of a topic, by its last name."""
        self.verifiers[name].add_recorded(stamps_of(columns), columns)

    def add_states(self, states: Sequence[RecordedState]) -> None:
        """Adds recorded EstimatorState messages."""
        self.estimator.add_states(states)

    def add_measurements(self, measured: Measurements, log_ns: int) -> None:
        """Adds measured heights, the last of which was recorded at `log_ns`."""
        known = self._newest["input"]
        latest = known.stamp - known.log_ns + log_ns + AHEAD_NS
        latest = MAXIMUM if self.unrelated or known.log_ns <= 0 else latest
        possible = (measured.stamps >= 0) & (measured.stamps <= latest)
        measured = self._sorted_out(measured, possible)
        if len(measured.stamps):
            self._measured.append(measured._replace(heights=measured.usable_heights))
            self._note("measurement", measured.stamps, log_ns)
            self.images += len(measured.stamps)

    def advance(self, *, final: bool = False) -> None:
        """Processes the data up to the stamp that all streams have reached.

        Args:
            final: nothing follows.

        Raises:
            SloshBagError: the stamps of the input go back.
        """
        if final:
            self._take_in(*self._filter.rest(), self._newest["input"].log_ns)
        self._estimate()
        if final:
            self.motions.finish()
        until = 2**62 if final else self._settled()
        self._release(until, final)
        if final and len(self._last_input):
            last_ns = int(self._last_input[0])
            for verifier in self.verifiers.values():
                verifier.lose(last_ns, AT_LAST)
                verifier.find(last_ns + BEHIND_LAST_NS)
        for verifier in self.verifiers.values():
            verifier.compare(until, final=final)

    def _estimate(self) -> None:
        """Computes estimates from the inputs that have come."""
        inputs, self._inputs = joined_messages(self._inputs), []
        for heights in self.estimator.update(inputs):
            self._keep(heights)
            if heights.accelerations is not None:
                self.motions.add(heights.stamps, heights.accelerations)

    def _note(self, side: str, stamps: Integers, log_ns: int) -> None:
        known = self._newest[side]
        self._newest[side] = _Newest(
            max(known.stamp, int(stamps.max())), max(known.log_ns, log_ns)
        )

    def _settled(self) -> int:
        """Returns the stamp [ns] up to which all data have arrived and been estimated."""
        newest, other = self._newest["input"], self._newest["measurement"]
        # A strange stamp of an image moves nothing on, as long as inputs come.
        if other.log_ns - newest.log_ns > BEHIND_NS:
            newest = other
        return newest.stamp - BEHIND_NS

    def _keep(self, new: ModelHeights) -> None:
        old = self._heights
        whole = new if old is None else joined([old, new])
        late = np.flatnonzero(np.diff(whole.stamps) <= 0)
        if len(late) and self._set_backs > SET_BACKS:
            raise SloshBagError(
                f"{self._name}: the stamps of the input go back {self._set_backs} times, first "
                f"at {whole.stamps[late[0]] * 1e-9:.3f} s, as when messages of several "
                "publishers are mixed on one topic; the recording cannot separate them: "
                "record one publisher at a time"
            )
        if len(late):
            raise SloshBagError(
                f"{self._name}: the stamps of the input go back at "
                f"{whole.stamps[late[0]] * 1e-9:.3f} s, where a clock was set back or messages "
                "were recorded later than ones sent after them: split the bag there with "
                f"`slosh recover --split {self._name} -o NEW` and replay each part"
            )
        self._heights = whole

    def _release(self, until: int, final: bool) -> None:
        """Passes all data up to a stamp [ns] to the stored series and to the dependent nodes."""
        if self.unrelated and not final:
            return
        measured, estimates = self._take_measured(until), self._heights
        if self.unrelated and estimates is not None:
            self.alignment = align(self._name, estimates, measured)
            measured, estimates = self.alignment.measured, self.alignment.estimates
            self.series.append(self.alignment.rows(self.series.dtype))
        else:
            has_camera = self.monitor.feed.monitor.settings.camera
            self._append(measured if has_camera else self._moments(until), estimates)
        due = None
        if estimates is not None:
            released = (estimates.stamps > self._released) & (estimates.stamps <= until)
            due = chosen(estimates, released)
        self.monitor.carry(self.estimator.tray_changes)
        comparisons = self.monitor.update(due, self.estimator.models.own, measured, final=final)
        if COMPARISON in self.verifiers and comparisons:
            self.verifiers[COMPARISON].add_replayed(*comparison_columns(comparisons))
        if due is None or estimates is None:
            return
        if len(due.stamps):
            self._released = int(due.stamps[-1])
        late = 0 if estimates.delays is None else max(int(estimates.delays.max()), 0)
        kept = estimates.stamps > min(until, int(estimates.stamps[-1])) - KEPT_NS - late
        self._heights = chosen(estimates, kept)

    def _moments(self, until: int) -> Measurements:
        """Returns the stamps at which estimates are plotted if the recording has no camera."""
        if self._heights is None:
            return NO_MEASUREMENTS
        stamps = self._heights.stamps
        stamps = stamps[(stamps > self._released) & (stamps <= until)]
        stamps = stamps[np.flatnonzero(np.diff(stamps // DRAWN_NS, prepend=-1))]
        unknown = np.full(len(stamps), np.nan)
        return Measurements(stamps, unknown, np.zeros(len(stamps), np.int64), unknown, unknown)

    def _take_measured(self, until: int) -> Measurements:
        """Returns the measurements up to a stamp [ns] in order."""
        if not self._measured:
            return NO_MEASUREMENTS
        waiting = joined(self._measured)
        due = waiting.stamps <= until
        self._measured = [chosen(waiting, np.flatnonzero(~due))]
        rows = np.flatnonzero(due)
        found = chosen(waiting, rows[np.argsort(waiting.stamps[rows], kind="stable")])
        # What comes behind its place in the order shows another time.
        kept = found.stamps > self._measured_until
        if kept.any():
            self._measured_until = int(found.stamps[-1])
        return self._sorted_out(found, kept)

    def _sorted_out(self, measured: Measurements, kept: NDArray[np.bool_]) -> Measurements:
        """Returns the selected measurements; counts the rejected ones as out of sequence."""
        astray = len(kept) - int(np.count_nonzero(kept))
        if not astray:
            return measured
        self._stray_images += astray
        return chosen(measured, np.flatnonzero(kept))

    def _append(self, measured: Measurements, estimates: ModelHeights | None) -> None:
        if not len(measured.stamps):
            return
        series = self.series
        rows = np.zeros(len(measured.stamps), dtype=series.dtype)
        rows["stamp"], rows["measured"] = measured.stamps, measured.heights
        rows["azimuth"], rows["flags"] = measured.azimuth, measured.flags
        rows["heights"], rows["model_azimuth"] = np.nan, np.nan
        if estimates is not None:
            found = at_images(estimates, measured.stamps)
            rows["heights"], rows["model_azimuth"] = found.heights, found.azimuth
            rows["usable"] = found.usable
        rows["motion"] = self.motions.number_at(measured.stamps)
        series.append(rows)


class _Newest(NamedTuple):
    """Greatest stamp and log time of a stream so far [ns]."""

    stamp: int = -(2**62)
    log_ns: int = -(2**62)
