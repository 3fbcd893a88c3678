"""Makes a source of images from image files: their times and the pages that TIFF files hold."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from slosh_base.files.nanoseconds import SECOND
from slosh_bringup.detect.frame import FOLDER_RATE, FrameSource, SourceFrame, TiffPage
from slosh_bringup.detect.name_times import doubtful_steps, name_times
from slosh_camera.images.tiff_pages import tiff_pages


def file_source(
    name: str,
    files: Sequence[Path],
    rate: float | None,
    present: Sequence[Path] = (),
    note: str = "",
) -> FrameSource:
    """Returns image files as a source, every page of a TIFF file as an image.

    Args:
        name: what people call the source.
        files: the images, in natural order.
        rate: images per second [Hz]; None: as the files' names say, or FOLDER_RATE.
        present: all images that are there; empty: these.
        note: what was left out of them, in words.
    """
    pages = [page for file in files for page in _pages(file)]
    notes = [note] if note else []
    if len(pages) != len(files):
        notes.append(f"{len(pages)} images, since TIFF files hold several pages")
    found = None
    if rate is None and len(pages) == len(files):
        found = name_times(files)
        if found is None and (doubt := doubtful_steps(files)):
            notes.append(doubt)
    if found is not None:
        notes.append(f"times are those in the files' names, in {found.unit}; --rate overrides it")
        ordered = sorted(zip(found.stamps_ns, files, strict=True))
        timed = (SourceFrame(stamp, file.name, file) for stamp, file in ordered)
        return FrameSource(name, timed, len(files), None, present or files, "; ".join(notes))
    rate = rate or FOLDER_RATE
    counted = _at_rate(pages, rate)
    return FrameSource(name, counted, len(pages), rate, present or files, "; ".join(notes))


def _pages(file: Path) -> list[Path | TiffPage]:
    """Returns the pictures in a file; a file with one picture is the picture."""
    numbers = tiff_pages(file)
    return [file] if len(numbers) < 2 else [TiffPage(file, number) for number in numbers]


def _at_rate(pages: Sequence[Path | TiffPage], rate: float) -> Iterator[SourceFrame]:
    for index, page in enumerate(pages):
        stamp = round(index * SECOND / rate)
        if isinstance(page, TiffPage):
            yield SourceFrame(stamp, f"{page.path.name} page {page.number + 1}", page)
        else:
            yield SourceFrame(stamp, page.name, page)
