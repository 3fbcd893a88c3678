"""Tuning parameters of the image checks."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_base.tuning import number


@dataclass(frozen=True, slots=True)
class ImagesTuning:
    """Assumptions of the image checks about cameras, drivers and torn images.

    Checked on damaged frames of the rendered sequences by `camera_damage.py` and
    `torn_images.py` in validation/studies.
    """

    # headers.py
    same_ratio: float = number(0.02, "1", "relative difference of two aspect ratios that are one")
    # seams.py, repeated images
    buffers: int = number(8, "1", "number of images that a driver may return in turn")
    bands: int = number(16, "1", "number of bands of rows that are compared")
    noisy: int = number(8, "1", "number of differing images after which a band has noise")
    noisy_bands: int = number(12, "1", "number of such bands after which a camera has noise")
    # seams.py
    least_seam: float = number(0.14, "contrast", "least step of a seam")
    sharp_seam: float = number(3.5, "1", "ratio of that step to those above and below")
    seam_run: int = number(5, "px", "shortest run of such pixels")
    seam_gap: int = number(2, "px", "distance of pixels in a run")
    seam_near: float = number(2.5, "px", "distance of a liquid's line that begins a seam")
    seam_along: float = number(1.2, "px", "distance of a line that runs along it")
    seam_parallel: float = number(30.0, "px", "the same times the number of pixels")
    seam_many: int = number(10, "px", "least length of a seam without a line")
    seam_beside: int = number(8, "row", "rows beside it that show fewer such pixels")
    seam_fewer: int = number(4, "1", "ratio of pixels on it and beside")
    seam_long: float = number(0.15, "1", "part of the width that is a seam in any case")
    seam_some: int = number(6, "px", "least length of a seam with a line")
    seam_some_fewer: int = number(2, "1", "ratio of pixels on it and beside")
    seam_step: float = number(6.0, "grey", "least step of a seam")
    still_seam: float = number(0.6, "1", "part of the step that is an edge of the still image")
    # still_edges.py
    edge_moved: int = number(4, "1", "samples by which it may have moved")
    edge_width: float = number(240.0, "px", "width above which samples are farther apart")
    least_places: int = number(8, "1", "fewest places that determine an edge")
    edge_lowest: float = number(-0.9, "fill height", "lower end of the sides that are compared")
    edge_highest: float = number(-0.5, "fill height", "upper end of them")
    edge_middle: float = number(0.8, "1", "part of floor and rim that is compared")
    edge_blur: float = number(1.5, "px", "smoothing before the comparison")
    edge_half: float = number(4.0, "grey", "step that counts as half an edge")
    edge_marked: float = number(3.0, "grey", "least step of an edge that is compared")
    edge_agrees: float = number(0.45, "1", "correlation of an edge that is still there")
    edge_better: float = number(1.1, "1", "gain in correlation of an edge that has moved")
    edge_black: int = number(3, "grey", "level below which a camera clips")
    edge_white: int = number(252, "grey", "level above which a camera clips")
    edge_clipped: float = number(0.5, "1", "part of clipped samples that hides an edge")


TUNING = ImagesTuning()
