"""HTML page on which the user clicks points for `slosh calibrate` and `slosh new`."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

import cv2

from slosh_camera.images.colour import Image
from slosh_report.page.template import image_uri, make_environment, script

PACKAGE = "slosh_bringup.scale_page"


SCALE = (
    "Click the left and the right end of the liquid’s still level, where it meets the inner wall. "
    "A further click moves the nearer end."
)
OUTLINE = (
    "Click the left and the right end of the rim, then the outside of the right wall from below "
    "the rim down to the floor, more closely where it bends. Backspace takes the last point back."
)
"""What to click."""


def render_clicks(
    image: Image,
    name: str,
    before: Sequence[str],
    after: Sequence[str],
    advice: str = SCALE,
    counts: tuple[int, int] = (2, 2),
) -> str:
    """Returns the HTML page on which the user clicks image points, as text.

    Args:
        image: as `slosh calibrate` reads it, whose pixels are counted.
        name: of the image's file.
        before, after: words of the command before and after the numbers.
        advice: what to click.
        counts: number of points, at least and at most.
    """
    template = make_environment(PACKAGE).get_template("clicks.html.j2")
    return template.render(
        title=f"Points of {name}",
        advice=advice,
        least=counts[0],
        most=counts[1],
        picture=image_uri(cv2.imencode(".png", image)[1].tobytes(), "image/png"),
        before=shlex.join(before),
        after=shlex.join(after),
        scripts=[script(PACKAGE, "clicks.js")],
    )
