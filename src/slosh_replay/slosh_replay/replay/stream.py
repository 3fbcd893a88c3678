"""Runs the estimator's and the monitor's cores over a bag: no DDS, no clock, the same numbers.

Images are not touched. Each stream is taken in the order in which it was recorded, the streams are
merged in the order of their stamps, two seconds behind the newest input: as much as an image may
need to become a height. So a replay holds seconds of a recording in memory, however long that is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Integers
from slosh_estimator.comparison import Comparison
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.inputs import InputSettings
from slosh_estimator.limits import Event
from slosh_estimator.sampling import modes_of
from slosh_estimator.validity import EstimateFlag
from slosh_metrics.input_checks.constancy import BIN_NS
from slosh_metrics.motion_spans import MotionFinder
from slosh_replay.recording.heights import Measurements
from slosh_replay.recording.inputs import InputReader, stamps_of
from slosh_replay.recording.settings import NodeStart, model_of, settings_of, starts_at_rest
from slosh_replay.recording.states import RecordedState
from slosh_replay.replay.input_matching import Decision, InputMatcher
from slosh_replay.replay.known_state import KnownState
from slosh_replay.replay.model_set import ModelHeights, ModelSet, ModelSetEstimates, at_images
from slosh_replay.replay.monitor_feed import Heights, MonitorFeed
from slosh_replay.replay.series import Series, chosen, joined
from slosh_replay.replay.verification import Verifier, comparison_columns, estimate_columns
from slosh_replay.strays import StrayFilter

Columns = Mapping[str, NDArray[Any]]

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
MAXIMUM = 2**31 * SECOND - 1
"""The last moment that a stamp can tell [ns]."""
_UNRECORDED = np.uint16(EstimateFlag.INPUT_CONTESTED)


class Outputs:
    """Receives what a replay gives, as it gives it; this one keeps nothing."""

    def begin(self, names: tuple[str, str]) -> None:
        """Is told the names of the loaded model's L and NL twin before anything comes."""

    def estimates(self, estimates: ModelSetEstimates) -> None:
        """Takes estimates in the order of their samples."""

    def comparisons(self, comparisons: list[Comparison]) -> None:
        """Takes comparisons in the order in which they were made."""

    def events(self, events: list[Event]) -> None:
        """Takes limit events."""


class Components(NamedTuple):
    """What a replay is made of.

    Attributes:
        models: the estimators.
        reader: of the input.
        monitor: the monitor's core.
        series: receives the images.
        verifier, comparisons: of recorded estimates and comparisons; None: there are none.
        matcher: decides which inputs the live estimator used; None: all.
        known: follows where the liquid's state is known; None: no state is recorded.
        counter: follows the estimator's counter of inputs, where no state is recorded; None: it
            tells nothing.
        changes: starts of the estimator after its first, and changes of its parameters, where
            the model follows the recording.
        follows_input: whether they also say how the input is read.
        outputs: receives all results.
    """

    models: ModelSet
    reader: InputReader
    monitor: MonitorFeed
    series: Series
    verifier: Verifier | None = None
    comparisons: Verifier | None = None
    matcher: InputMatcher | None = None
    known: KnownState | None = None
    counter: KnownState | None = None
    changes: tuple[NodeStart, ...] = ()
    follows_input: bool = True
    outputs: Outputs = Outputs()


class ReplayStream:
    """A replay in progress: the streams of a recording, merged in the order of their stamps.

    Attributes:
        motions: those of the container so far.
        events: limit events so far.
        images: measurements so far.
        unused: inputs that the live estimator did not use.
        untaken: why the estimator's recorded state cannot be taken up; empty: it can.
    """

    def __init__(self, name: str, components: Components) -> None:
        self._components = components
        self.motions = MotionFinder()
        self.events: list[Event] = []
        self.images = self.unused = 0
        self.untaken = ""
        self._stray_images = 0
        later = [self._input_settings(c) for c in components.changes if c.changed]
        gaps = [round(one.gate.max_gap * 1e9) for one in later if one is not None]
        self._filter = StrayFilter(max([components.reader.max_gap_ns, *gaps]))
        self._measured_until = -(2**62)
        self._name = name
        self._changes = list(components.changes)
        self._inputs: list[tuple[Integers, Columns]] = []
        self._set_backs = 0  # of the inputs' stamps
        self._measured: list[Measurements] = []
        self._heights: ModelHeights | None = None
        self._released = -(2**62)
        components.reader.carry(modes_of(components.models.model))
        self._newest = {"input": _Newest(), "measurement": _Newest()}
        components.outputs.begin(components.models.own_names)

    @property
    def strays(self) -> Mapping[str, int]:
        """Inputs and images that were set aside, as their stamps lie elsewhere in time."""
        return {"inputs": self._filter.count, "images": self._stray_images}

    def add_input(self, columns: Columns, log_ns: int) -> None:
        """Takes messages of the input.

        Args:
            columns: their fields, (N,) each.
            log_ns: when the last of them was recorded [ns].
        """
        self._take_in(*self._filter.add(stamps_of(columns), columns), log_ns)

    def _take_in(self, stamps: Integers, columns: Columns, log_ns: int) -> None:
        if len(stamps):
            before = self._inputs[-1][0][-1:] if self._inputs else stamps[:0]
            self._set_backs += int((np.diff(stamps, prepend=before) < 0).sum())
            self._inputs.append((stamps, columns))
            self._note("input", stamps, log_ns)

    def add_recorded(self, columns: Columns) -> None:
        """Takes recorded estimates."""
        stamps = stamps_of(columns)
        if self._components.verifier is not None:
            # Who else spoke on the input is in no recording.
            told = {**columns, "flags": columns["flags"] & ~_UNRECORDED}
            self._components.verifier.add_recorded(stamps, told)
        if self._components.matcher is not None:
            self._components.matcher.add_recorded(stamps, columns["samples_used"].astype(np.int64))

    def add_states(self, states: Sequence[RecordedState]) -> None:
        """Takes recorded states of the estimator."""
        if self._components.known is not None:
            self._components.known.add(states)

    def add_comparisons(self, columns: Columns) -> None:
        """Takes recorded comparisons."""
        if self._components.comparisons is not None:
            spoken = ~columns["measured_stale"].astype(bool)
            rows = {name: column[spoken] for name, column in columns.items()}
            self._components.comparisons.add_recorded(stamps_of(rows), rows)

    def add_measurements(self, measured: Measurements, log_ns: int) -> None:
        """Takes measured heights, the last of which was recorded at `log_ns`."""
        known = self._newest["input"]
        latest = known.stamp - known.log_ns + log_ns + AHEAD_NS if known.log_ns > 0 else MAXIMUM
        possible = (measured.stamps >= 0) & (measured.stamps <= latest)
        measured = self._sorted_out(measured, possible)
        if len(measured.stamps):
            self._measured.append(measured._replace(heights=measured.usable_heights))
            self._note("measurement", measured.stamps, log_ns)
            self.images += len(measured.stamps)

    def advance(self, *, final: bool = False) -> None:
        """Goes on as far as what has come allows.

        Args:
            final: nothing follows.

        Raises:
            SloshBagError: the stamps of the input go back.
        """
        if final:
            self._take_in(*self._filter.rest(), self._newest["input"].log_ns)
        self._estimate(final)
        if final:
            self.motions.finish()
        until = 2**62 if final else self._settled()
        self._release(until)
        if final:
            self._take_comparisons(self._components.monitor.finish())
        if self._components.verifier is not None:
            self._components.verifier.compare(until, final=final)
        if self._components.comparisons is not None:
            # An image waits for the estimate behind it.
            self._components.comparisons.compare(until - BEHIND_NS, final=final)
        if self._components.matcher is not None and not self._inputs:
            self._components.matcher.forget(until)

    def _note(self, side: str, stamps: Integers, log_ns: int) -> None:
        known = self._newest[side]
        self._newest[side] = _Newest(
            max(known.stamp, int(stamps.max())), max(known.log_ns, log_ns)
        )

    def _settled(self) -> int:
        """Up to this stamp everything has come, and every input has become an estimate [ns]."""
        newest, other = self._newest["input"], self._newest["measurement"]
        # A strange stamp of an image moves nothing on, as long as inputs come.
        if other.log_ns - newest.log_ns > BEHIND_NS:
            newest = other
        until = newest.stamp - BEHIND_NS
        if self._inputs:
            # The motions are known up to the bin before.
            until = min(until, int(self._inputs[0][0][0]) - 1 - BIN_NS)
        return until

    def _estimate(self, final: bool) -> None:
        """Decided inputs become estimates."""
        if not self._inputs:
            return
        stamps = np.concatenate([taken[0] for taken in self._inputs])
        columns = {
            name: np.concatenate([taken[1][name] for taken in self._inputs])
            for name in self._inputs[0][1]
        }
        matcher = self._components.matcher
        everything = Decision(len(stamps), np.ones(len(stamps), dtype=bool), [])
        decision = matcher.decide(stamps, final=final) if matcher else everything
        count, used = decision.reached, decision.used
        self.unused += count - int(np.count_nonzero(used))
        # What belongs to the inputs before an index comes first.
        actions = self._known_again(stamps, decision)
        actions += self._due(stamps[:count], decision.restarts)
        start = 0
        for index, act in sorted(actions, key=lambda action: action[0]):
            self._take(stamps, columns, used, start, index)
            act()
            start = index
        self._take(stamps, columns, used, start, count)
        rest = slice(count, None)
        self._inputs = [(stamps[rest], {name: c[rest] for name, c in columns.items()})]
        if count == len(stamps):
            self._inputs = []

    def _due(
        self, stamps: Integers, restarts: Sequence[int]
    ) -> list[tuple[int, Callable[[], None]]]:
        """New processes, models and parameters that fall among the inputs with these stamps.

        Args:
            stamps: (N,) [ns].
            restarts: indices of inputs with which a new process began.
        """
        actions: list[tuple[int, Callable[[], None]]] = []
        waiting, begin = list(restarts), 0
        while self._changes:
            change = self._changes[0]
            if change.is_process:
                if not waiting:
                    break
                begin = waiting.pop(0)
                actions.append((begin, partial(self._restart, change)))
            else:
                later = np.flatnonzero(stamps[begin:] > change.stamp_ns)
                if not len(later):
                    break
                act = self._change if change.changed else self._load
                actions.append((begin + int(later[0]), partial(act, change)))
            self._changes.pop(0)
        return actions + [(index, self._restart) for index in waiting]

    def _known_again(
        self, stamps: Integers, decision: Decision
    ) -> list[tuple[int, Callable[[], None]]]:
        """Recorded states that are taken up among the inputs with these stamps."""
        if self._components.counter is not None:
            self._components.counter.follow(stamps, decision)
        if self._components.known is None:
            return []
        course = self._components.known.follow(stamps, decision)
        models = self._components.models
        actions: list[tuple[int, Callable[[], None]]] = []
        if course.unknown:
            actions.append((0, partial(models.restart, at_rest=False)))
        return actions + [(index, partial(self._take_up, state)) for index, state in course.states]

    def _take_up(self, state: RecordedState) -> None:
        try:
            self._components.models.take_up(state.estimator)
            self._components.reader.take_up(state.stamp_ns, state.memory)
        except SloshEstimatorError as error:
            self.untaken = str(error)

    def _load(self, change: NodeStart) -> None:
        model = model_of(change)
        self._components.models.load_model(model)
        self._components.reader.carry(modes_of(model))
        self._components.outputs.begin(self._components.models.own_names)

    def _change(self, change: NodeStart) -> None:
        settings = self._input_settings(change)
        if settings is not None:
            self._components.reader.change(settings)

    def _input_settings(self, start: NodeStart) -> InputSettings | None:
        """How the node reads its input from then on; None: the replay does not follow it."""
        if not self._components.follows_input or "input" not in start.parameters:
            return None
        return settings_of(start, InputSettings.from_parameters)

    def _restart(self, start: NodeStart | None = None) -> None:
        """The node's process was a new one from here on; None: what it tells is not known."""
        if start is None:
            self._components.reader.restart()
        else:
            self._components.reader.restart(self._input_settings(start))
            self._load(start)
        self._components.models.restart(at_rest=starts_at_rest(start))

    def _take(
        self, stamps: Integers, columns: Columns, used: NDArray[np.bool_], start: int, end: int
    ) -> None:
        rows = start + np.flatnonzero(used[start:end])
        if not len(rows):
            return
        samples = self._components.reader.samples(stamps, columns, rows)
        if not len(samples.stamps):
            return
        answers = self._components.models.update_many(samples)
        own = answers.own
        if self._components.verifier is not None:
            self._components.verifier.add_replayed(own.stamps, estimate_columns(own))
        self._components.outputs.estimates(answers)
        self._keep(answers.heights)
        self.motions.add(own.stamps, own.accelerations)

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

    def _release(self, until: int) -> None:
        """Feeds the monitor and the series with everything up to a moment."""
        measured = self._take_measured(until)
        estimates = self._heights
        has_camera = self._components.monitor.monitor.settings.camera
        self._append(measured if has_camera else self._moments(until), estimates)
        if estimates is None:
            self._monitor(_NOTHING, measured)
            return
        due = (estimates.stamps > self._released) & (estimates.stamps <= until)
        self._monitor(monitored(chosen(estimates, due), self._components.models.own), measured)
        if due.any():
            self._released = int(estimates.stamps[due][-1])
        late = 0 if estimates.delays is None else max(int(estimates.delays.max()), 0)
        kept = estimates.stamps > min(until, int(estimates.stamps[-1])) - KEPT_NS - late
        self._heights = chosen(estimates, kept)

    def _moments(self, until: int) -> Measurements:
        """Moments without a measurement at which estimates are drawn, where no camera is."""
        if self._heights is None:
            return _NONE
        stamps = self._heights.stamps
        stamps = stamps[(stamps > self._released) & (stamps <= until)]
        stamps = stamps[np.flatnonzero(np.diff(stamps // DRAWN_NS, prepend=-1))]
        unknown = np.full(len(stamps), np.nan)
        return Measurements(stamps, unknown, np.zeros(len(stamps), np.int64), unknown, unknown)

    def _take_measured(self, until: int) -> Measurements:
        """The measurements up to a moment, in the order of their stamps."""
        if not self._measured:
            return _NONE
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
        """Those that are kept; the others are counted as strays."""
        astray = len(kept) - int(np.count_nonzero(kept))
        if not astray:
            return measured
        self._stray_images += astray
        return chosen(measured, np.flatnonzero(kept))

    def _monitor(self, estimates: Heights, measured: Measurements) -> None:
        self._take_comparisons(self._components.monitor.add(estimates, measured))

    def _take_comparisons(self, comparisons: list[Comparison]) -> None:
        if comparisons:
            self._components.outputs.comparisons(comparisons)
            if self._components.comparisons is not None:
                self._components.comparisons.add_replayed(*comparison_columns(comparisons))
        events = self._components.monitor.take_events()
        if events:
            self.events += events
            self._components.outputs.events(events)

    def _append(self, measured: Measurements, estimates: ModelHeights | None) -> None:
        if not len(measured.stamps):
            return
        series = self._components.series
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


def monitored(estimates: ModelHeights, own: tuple[int, int]) -> Heights:
    """What the monitor is told of estimates.

    Args:
        estimates: of all models.
        own: which of them are the loaded model's L and NL twin.
    """
    columns = list(own)
    heights, readings = estimates.heights[:, columns], estimates.as_read[:, columns]
    delayed = estimates.delays is not None and estimates.delays.any()
    return Heights(
        estimates.stamps,
        heights[:, 0],
        heights[:, 1],
        estimates.flags,
        None if np.array_equal(heights, readings, equal_nan=True) else readings,
        estimates.delays if delayed else None,
        estimates.azimuth,
        estimates.accelerations,
    )


class _Newest(NamedTuple):
    """The greatest stamp and log time of a side so far [ns]."""

    stamp: int = -(2**62)
    log_ns: int = -(2**62)


_FLOATS, _WHOLE = np.empty(0), np.empty(0, dtype=np.int64)
_NONE = Measurements(_WHOLE, _FLOATS, _WHOLE, _FLOATS, _FLOATS)
_NOTHING = Heights(_WHOLE, _FLOATS, _FLOATS, _WHOLE)
