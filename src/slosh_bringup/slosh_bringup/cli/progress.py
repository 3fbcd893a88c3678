"""Progress on the terminal."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tqdm import tqdm

Progress = Callable[[float, str], None]
WORDS = "{desc}"


@contextmanager
def progress_bar(title: str, length: float, *, quiet: bool = False) -> Iterator[Progress]:
    """A bar over a known length [s]; what is told last stays on the screen."""
    form = "{desc}: {percentage:3.0f}%|{bar:30}| {n:.0f}/{total:.0f} s"
    with tqdm(total=length, desc=title, bar_format=form, disable=quiet) as bar:

        def tell(elapsed: float, text: str) -> None:
            _show(bar, min(elapsed, length), text or title, WORDS if text else form)

        yield tell
        bar.n = length
        bar.set_description_str(title, refresh=False)


@contextmanager
def clock(title: str) -> Iterator[Progress]:
    """The elapsed time of something without a known end."""
    form = "{desc}: {n:.0f} s"
    with tqdm(desc=title, bar_format=form) as bar:

        def tell(elapsed: float, text: str) -> None:
            _show(bar, elapsed, text or title, WORDS if text else form)

        yield tell


def _show(bar: tqdm, elapsed: float, text: str, form: str) -> None:
    """Shows a moment: with words of its own it is those alone, in one line."""
    columns = shutil.get_terminal_size().columns
    bar.n, bar.bar_format = elapsed, form
    bar.set_description_str(text if len(text) < columns else f"{text[: columns - 2]}…")


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
