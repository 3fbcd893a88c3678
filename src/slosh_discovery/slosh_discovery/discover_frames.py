"""Returns camera images at the times of the base model's largest residuals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from slosh_bag.errors import SloshBagError
from slosh_base.files.nanoseconds import SECOND
from slosh_discovery.discover.finding import WorstMoment
from slosh_discovery.discover_data.recording import read_recording, sources_of
from slosh_discovery.discovery_report.words import LETTERS
from slosh_report.page.frame import Frame

Pictures = Callable[[Path, Mapping[str, int]], Mapping[str, tuple[bytes, float]]]
"""Of a bag and stamps by label [ns]: images with the detected line as JPEG, and the heights in
them [m], by label; what the bag does not hold is left out."""
MOST = 3
"""Images on a page."""


def worst_frames(
    data: Iterable[Path], worst: Sequence[WorstMoment], pictures: Pictures
) -> tuple[Frame, ...]:
    """Returns images with the detected surface at the times of the largest residuals, if any.

    Args:
        data: bags, and folders of them; a motion's name tells which bag it is of.
        worst: moments, the worst first.
        pictures: gives a bag's images.
    """
    bags = _bags(data)
    shown = dict(zip(LETTERS, worst[:MOST], strict=False))
    wanted: dict[Path, dict[str, WorstMoment]] = {}
    for letter, moment in shown.items():
        bag = bags.get(moment.motion.partition("#")[0])
        if bag is not None:
            wanted.setdefault(bag, {})[letter] = moment
    # A bag may be long: it is read once for all of its moments.
    found = {
        letter: picture
        for bag, moments in wanted.items()
        for letter, picture in _pictures(bag, moments, pictures).items()
    }
    return tuple(
        Frame(
            found[letter][0],
            f"{letter}: {moment.motion}, {moment.t:.2f} s, {1e3 * found[letter][1]:.1f} mm",
        )
        for letter, moment in shown.items()
        if letter in found
    )


def _bags(data: Iterable[Path]) -> dict[str, Path]:
    """Returns bags by name, without those that share a name."""
    paths = [path for top in data for path in (top, *(top.iterdir() if top.is_dir() else ()))]
    bags = [path for path in paths if path.suffix == ".mcap" or _is_bag(path)]
    inside = {path for path in bags if path.parent in bags}
    names = [path.name.removesuffix(".mcap") for path in bags if path not in inside]
    found = dict(zip(names, (path for path in bags if path not in inside), strict=True))
    return {name: path for name, path in found.items() if names.count(name) == 1}


def _is_bag(path: Path) -> bool:
    return path.is_dir() and any(path.glob("*.mcap"))


def _pictures(
    bag: Path, moments: Mapping[str, WorstMoment], pictures: Pictures
) -> Mapping[str, tuple[bytes, float]]:
    """Returns images with the detected line as JPEG and their heights [m], by letter."""
    try:
        recording = read_recording(bag, *sources_of(bag), lambda line: None)
    except SloshBagError:
        return {}
    # A motion counts seconds from the recording's first input.
    start = int(recording.motion.stamps[0])
    stamps = {letter: start + round(moment.t * SECOND) for letter, moment in moments.items()}
    return pictures(bag, stamps)
