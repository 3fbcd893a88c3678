"""The page on which two clicks give the points for `slosh calibrate --scale`."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

import cv2

from slosh_camera.images.colour import Image
from slosh_report.page.template import image_uri, make_environment, script

PACKAGE = "slosh_bringup.scale_page"


def render_clicks(image: Image, name: str, before: Sequence[str], after: Sequence[str]) -> str:
    """Renders the page as HTML.

    Args:
        image: as `slosh calibrate` reads it, whose pixels are counted.
        name: of the image's file.
        before, after: words of the command before and after the four numbers.
    """
    template = make_environment(PACKAGE).get_template("clicks.html.j2")
    return template.render(
        title=f"Scale of {name}",
        picture=image_uri(cv2.imencode(".png", image)[1].tobytes(), "image/png"),
        before=shlex.join(before),
        after=shlex.join(after),
        scripts=[script(PACKAGE, "clicks.js")],
    )
