"""Tests that messages contain the values of the estimate, from the first one on."""

from slosh_estimator.estimator import Estimate, Estimator
from slosh_estimator.nodes.estimator_messages import fill
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_motion.inputs.sampling import Sample
from slosh_msgs.msg import SloshEstimate

TILTED = Model(Cylinder(0.05, 0.07)).with_effect("static_tilt", roll=0.05, pitch=-0.03)


def modal(message: SloshEstimate) -> list[float]:
    """Returns x, y, vx, vy of each mode of the linear model in a message."""
    place, speed = message.linear.modal_position, message.linear.modal_velocity
    rows = [
        [*place[at : at + 2], *speed[at : at + 2]]
        for at in range(0, len(message.linear.modal_position), 2)
    ]
    return [value for row in rows for value in row]


def estimate(model: Model) -> Estimate:
    """Returns the estimate for the second of two samples."""
    estimator = Estimator(model)
    estimator.update(Sample(0, 1.0, 0.0, 0.0, 0.0, True))
    return estimator.update(Sample(5_000_000, 2.0, -1.0, 0.0))


def test_the_first_message_holds_the_modal_state() -> None:
    """Tests that the first message of a tilted cup contains a modal state that is not zero."""
    first, message = Estimator(TILTED).update(Sample(0, 0.0, 0.0, 0.0, 0.0, True)), SloshEstimate()
    fill(message, first, TILTED.container.wall)
    assert any(first.linear.modal)
    assert modal(message) == first.linear.modal


def test_a_model_with_another_number_of_modes_is_taken_up_at_once() -> None:
    message = SloshEstimate()
    for model in (TILTED, TILTED.with_effect("second_mode"), TILTED):
        one = estimate(model)
        fill(message, one, model.container.wall)
        assert modal(message) == one.linear.modal
        assert list(message.nonlinear.modal_velocity[:2]) == one.nonlinear.modal[2:4]
