import numpy as np
import pytest

from slosh_camera.cylinder.surface import USUAL_FADE
from slosh_camera.cylinder.surface_memory import SurfaceMemory

RADIUS, FILL = 0.05, 0.07
MM = 1e-3
SECOND = 1_000_000_000
FRAME = SECOND // 60
# Of DL22 for this container.
OMEGA = np.sqrt(9.81 * 1.841184 / RADIUS * np.tanh(1.841184 * FILL / RADIUS))


def swing(stamp_ns, size=20.0 * MM):
    """Returns the first mode of a free rotating oscillation at a stamp."""
    phase = OMEGA * stamp_ns / SECOND
    return size * np.array([np.cos(phase), 0.6 * np.sin(phase)])


def remembered(*stamps, place=swing, **given):
    memory = SurfaceMemory(RADIUS, FILL)
    for stamp in stamps:
        flags = {"decided": False, "jumped": False} | given
        memory.remember(stamp, place(stamp), USUAL_FADE, **flags)
    return memory


def test_two_images_foretell_the_third():
    expected = remembered(0, FRAME).expected(2 * FRAME)
    assert expected.first == pytest.approx(swing(2 * FRAME), abs=0.01 * MM)
    assert 1.0 * MM < expected.stddev < 5.0 * MM
    # Also where images are missing: less well.
    later = remembered(0, FRAME).expected(4 * FRAME)
    assert later.first == pytest.approx(swing(4 * FRAME), abs=0.01 * MM)
    assert later.stddev > 2.0 * expected.stddev


def test_a_robots_acceleration_is_no_jump():
    # A step of 8 m/s² after rest moves the crest by gain a t²/2 per frame.
    gain = 8.0 * np.tanh(1.841184 * FILL / RADIUS) / (1.841184 * (1.841184**2 - 1.0))

    def pushed(stamp):
        return np.array([0.5 * gain * 8.0 * (stamp / SECOND) ** 2, 0.0])

    expected = remembered(0, FRAME, place=pushed).expected(2 * FRAME)
    assert expected.distance(pushed(2 * FRAME)) < 2.5


@pytest.mark.parametrize("stamp", [FRAME, FRAME + 1000, 0, -SECOND, FRAME + SECOND], ids=str)
def test_a_repeated_or_earlier_stamp_and_a_gap_foretell_nothing(stamp):
    assert remembered(0, FRAME).expected(stamp) is None


def test_what_the_memory_decided_does_not_feed_it_for_ever():
    memory = remembered(0, FRAME)
    spreads = []
    for number in range(2, 9):
        moment = number * FRAME
        memory.remember(moment, swing(moment), USUAL_FADE, decided=True, jumped=False)
        spreads.append(memory.expected(moment + FRAME).stddev)
    # After five in a row it starts again, from the next image alone.
    assert np.allclose(spreads[:5], spreads[0])
    assert spreads[5] > 1.2 * spreads[0]


def test_a_crest_that_does_not_swing_stands():
    """Real liquid oscillates; repeated images and a tilted container do not."""
    rng = np.random.default_rng(5)
    size, noise = 12.0 * MM, 0.05 * MM
    stamps = [k * FRAME for k in range(60)]

    def standing(place):
        told = []
        memory = SurfaceMemory(RADIUS, FILL)
        for stamp in stamps:
            memory.remember(stamp, place(stamp), USUAL_FADE, decided=False, jumped=False)
            told.append(memory.crest_stands)
        return told

    told = standing(lambda _: np.array([size, 0.0]) + rng.normal(0.0, noise, 2))
    periods = np.array(stamps) / SECOND * OMEGA / (2.0 * np.pi)
    np.testing.assert_array_equal(told, periods > 2.0)
    # Rest, a wave, a rotating one, and one beside a constant acceleration.
    assert not any(standing(lambda _: rng.normal(0.0, noise, 2)))
    assert not any(standing(swing))
    assert not any(standing(lambda stamp: swing(stamp) * [1.0, 0.0]))
    assert not any(standing(lambda stamp: np.array([size, 0.0]) + swing(stamp, 0.5 * MM)))
