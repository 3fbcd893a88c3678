"""Tests that edges seen through clear liquids cause no wrong heights without a flag.

Single images of scenes that `validation/scenes/render.py liquids clear sequence_59 sequence_111`
draws, each with the image of the liquid at rest.
"""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from camera_sequences import FrameTruth, read_image, read_sequence

from slosh_bringup.cli.main import main
from slosh_camera.calibrate.camera_file import format_calibration
from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.detection.detectors import learnt_detector, still_doubt
from slosh_camera.errors import SloshCameraError
from slosh_camera.measurement import Flag, Measurement
from slosh_camera.optics.camera import Pose
from slosh_camera.optics.cup import CupView

SCENES = Path(__file__).parent / "scenes"
MM = 1e-3


def detector_of(name: str) -> FreeSurfaceDetector:
    sequence = read_sequence(SCENES / name)
    detector = learnt_detector(sequence.calibration, sequence.still)
    assert isinstance(detector, FreeSurfaceDetector)
    return detector


def measured(name: str) -> tuple[FrameTruth, Measurement]:
    """Returns the exact data and the measurement of a scene's last image."""
    frame = read_sequence(SCENES / name).frames[-1]
    return frame, detector_of(name).measure(0, read_image(frame.path))


def test_clear_water_is_refused_with_what_helps() -> None:
    """The table's far edge, seen through the water, ends it more clearly than its surface."""
    with pytest.raises(SloshCameraError, match=r"at rest would be measured as a wave .* dye"):
        detector_of("liquid_water")


def test_a_doubtful_line_far_from_the_calibration_s_level_is_refused() -> None:
    """The level lies 8 mm higher than told: a dark liquid leaves no doubt, tea does."""
    for name, believed in (("nonlinear_dark", True), ("liquid_tea", False)):
        sequence = read_sequence(SCENES / name)
        view, still = sequence.calibration.view, sequence.still
        assert still is not None
        lowered = view.pose.translation - 8.0 * MM * view.pose.rotation[:, 2]
        view = CupView(view.camera, Pose(view.pose.rotation, lowered), view.cup)
        detector = FreeSurfaceDetector(replace(sequence.calibration, view=view))
        if believed:
            assert detector.learn_still(read_image(still)) == pytest.approx(8.0 * MM, abs=1.0 * MM)
        else:
            with pytest.raises(SloshCameraError, match=r"is .* off the calibration's level"):
                detector.learn_still(read_image(still))


def test_an_edge_seen_through_tea_is_not_its_line() -> None:
    """Nearly all of the front line lay on the edge of what is behind the tea."""
    true, found = measured("liquid_tea")
    assert found.msh == pytest.approx(true.msh, abs=0.3 * MM)
    assert not found.flags


def test_a_label_over_the_line_leaves_a_doubt_that_is_told() -> None:
    true, found = measured("liquid_label")
    assert abs(found.msh - true.msh) < 1.0 * MM or Flag.AMBIGUOUS in found.flags


def test_the_shade_that_is_the_front_line_of_milk_moves_nothing() -> None:
    """Where milk climbs at the wall its front line is seen up to three rows too high."""
    true, found = measured("sequence_111")
    assert not detector_of("sequence_111").doubt
    assert found.msh == pytest.approx(true.msh, abs=0.2 * MM)
    assert found.fitted_msh == pytest.approx(true.msh, abs=0.2 * MM)
    assert not found.flags


def test_a_liquid_that_looks_like_its_surroundings_is_doubted() -> None:
    """At rest the table's edge lies at the line itself: only the colour beside tells."""
    detector = detector_of("clear_20")
    assert "dye the liquid" in detector.doubt
    true, found = measured("clear_20")
    assert abs(found.msh - true.msh) > 1.0 * MM
    assert Flag.AMBIGUOUS in found.flags


@pytest.mark.parametrize("name", ["nonlinear_dark", "steep", "liquid_tea", "liquid_label"])
def test_liquids_that_differ_from_their_background_are_not_doubted(name: str) -> None:
    assert not detector_of(name).doubt


@pytest.mark.parametrize(
    ("name", "words"),
    [("liquid_water", "as a wave"), ("clear_20", "is too low"), ("liquid_tea", "")],
)
def test_the_still_image_alone_tells(name: str, words: str) -> None:
    sequence = read_sequence(SCENES / name)
    assert sequence.still is not None
    doubt = still_doubt(sequence.calibration, read_image(sequence.still))
    assert words in doubt
    assert bool(doubt) == bool(words)


def test_detection_begins_with_a_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sequence = read_sequence(SCENES / "clear_20")
    camera = tmp_path / "camera.yaml"
    camera.write_text(
        format_calibration(replace(sequence.calibration, still_image=sequence.still))
    )
    words = ["detect", SCENES / "clear_20" / "frame_007.jpg", "--camera", camera, "--json"]
    assert main([str(word) for word in (*words, "-o", tmp_path / "out.csv")]) == 0
    captured = capsys.readouterr()
    (line,) = captured.err.strip().splitlines()
    assert line.startswith("slosh detect: warning: still image: the contrast between")
    assert "dye the liquid" in json.loads(captured.out)["warnings"][0]
