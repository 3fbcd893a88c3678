"""Progress on the terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tqdm import tqdm

Progress = Callable[[float, str], None]


@contextmanager
def progress_bar(title: str, length: float, *, quiet: bool = False) -> Iterator[Progress]:
    """A bar over a known length [s]; what is told last stays on the screen."""
    form = "{desc}: {percentage:3.0f}%|{bar:30}| {n:.0f}/{total:.0f} s"
    with tqdm(total=length, desc=title, bar_format=form, disable=quiet) as bar:

        def tell(elapsed: float, text: str) -> None:
            bar.n = min(elapsed, length)
            bar.refresh()

        yield tell
        bar.n = length


@contextmanager
def clock(title: str) -> Iterator[Progress]:
    """The elapsed time of something without a known end."""
    with tqdm(desc=title, bar_format="{desc}: {n:.0f} s") as bar:

        def tell(elapsed: float, text: str) -> None:
            bar.n = elapsed
            bar.refresh()

        yield tell


@contextmanager
def share_bar(title: str) -> Iterator[Callable[[str, float], None]]:
    """A bar over a share in [0, 1], with what is being done beside it."""
    with tqdm(total=1.0, desc=title, bar_format="{desc}: {percentage:3.0f}%|{bar:30}|") as bar:

        def tell(text: str, share: float) -> None:
            bar.n = min(max(share, 0.0), 1.0)
            bar.set_description_str(f"{title}: {text}" if text else title, refresh=True)

        yield tell


@contextmanager
def item_progress(title: str, count: int, unit: str) -> Iterator[tqdm]:
    """A bar over a number of items; none for a single one."""
    with tqdm(desc=title, total=count, unit=unit, disable=count <= 1) as bar:
        yield bar
