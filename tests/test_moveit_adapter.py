"""Tests the adapter of docs/moveit.md with replacements of MoveIt and rclcpp."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ADAPTER = ROOT / "docs/examples/moveit/limit_sloshing.cpp"
STUB = Path(__file__).with_name("moveit_stub.hpp")
MESSAGES = "slosh_msgs/srv/predict_slosh.hpp"
MAIN = """
#include "limit_sloshing.cpp"
#include <cstdlib>
using Client = rclcpp::Client<slosh_msgs::srv::PredictSlosh>;

int main(int, char** words) {
  const bool answered = std::atoi(words[1]), success = std::atoi(words[2]);
  const double excess = std::atof(words[3]), scale = std::atof(words[4]);
  Client::answer = [=](const slosh_msgs::srv::PredictSlosh::Request& asked) -> Client::Response {
    const auto& last = asked.trajectory.points.back();
    std::printf("asked %zu points, last at %d.%09u s, %g m, limit %g\\n",
                asked.trajectory.points.size(), last.time_from_start.sec,
                last.time_from_start.nanosec, last.transforms[0].translation.x, asked.limit);
    if (!answered) return nullptr;
    auto made = std::make_shared<slosh_msgs::srv::PredictSlosh::Response>();
    made->success = success;
    made->message = "no model";
    made->excess = excess;
    made->time_scale = scale;
    return made;
  };
  planning_interface::MotionPlanResponse res;
  res.trajectory = std::make_shared<robot_trajectory::RobotTrajectory>();
  for (int i = 0; i < 3; ++i) {
    auto state = std::make_shared<moveit::core::RobotState>();
    state->pose.place.v = {0.1 * i, 0.0, 0.0};
    state->velocity = {1.0};
    state->acceleration = {4.0};
    res.trajectory->states.push_back(state);
    res.trajectory->durations.push_back(i ? 0.75 : 0.0);
  }
  slosh_moveit::LimitSloshing adapter;
  adapter.initialize(std::make_shared<rclcpp::Node>("pipeline"), "ompl");
  adapter.adapt(nullptr, {}, res);
  const auto& last = *res.trajectory->states[2];
  std::printf("code %d, %g s, %g, %g\\n", res.error_code.val,
              res.trajectory->getWayPointDurationFromStart(2), last.velocity[0],
              last.acceleration[0]);
}
"""
ASKED = "asked 3 points, last at 1.500000000 s, 0.2 m, limit 0.015\n"


def includes():
    """Returns the include folders of the messages' C++ headers."""
    roots = [ROOT / "ros2_ws/install", Path(sys.prefix), Path("/opt/ros/jazzy")]
    found = [
        folder for root in roots for folder in (root / "include").glob("*") if folder.is_dir()
    ]
    return [f"-I{folder}" for folder in found]


@pytest.fixture(scope="module")
def adapter(tmp_path_factory):
    if shutil.which("g++") is None:
        pytest.skip("no C++ compiler")
    if not any(Path(folder[2:], MESSAGES).exists() for folder in includes()):
        pytest.skip("the messages' C++ headers are not built")
    folder = tmp_path_factory.mktemp("adapter")
    names = re.findall(r"#include <((?:class_loader|moveit|rclcpp)/[^>]+)>", ADAPTER.read_text())
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(f'#include "{STUB}"\n')
    (folder / "main.cpp").write_text(MAIN)
    program = folder / "adapter"
    subprocess.run(
        ["g++", "-std=c++17", "-Wall", "-Werror", f"-I{folder}", f"-I{ADAPTER.parent}",
         *includes(), str(folder / "main.cpp"), "-o", str(program)],
        check=True,
    )  # fmt: skip
    return program


@pytest.mark.long
@pytest.mark.parametrize(
    ("answer", "told"),
    [
        (("1", "1", "0", "1.4"), "code 1, 1.5 s, 1, 4\n"),
        (("1", "1", "0.01", "2"), "code 1, 3 s, 0.5, 1\n"),
        (("1", "1", "0.01", "nan"),
         "motion refused: the liquid exceeds its limit however slow the motion\n"
         "code -2, 1.5 s, 1, 4\n"),
        (("1", "0", "0", "1"), "motion refused: no model\ncode -2, 1.5 s, 1, 4\n"),
        (("0", "0", "0", "1"),
         "motion refused: the predictor does not answer\ncode -2, 1.5 s, 1, 4\n"),
    ],
    ids=["keeps the limit", "is slowed", "cannot be slowed", "refused", "no answer"],
)  # fmt: skip
def test_a_motion_that(adapter, answer, told):
    done = subprocess.run([adapter, *answer], capture_output=True, text=True, check=True)
    assert done.stdout == ASKED + told


def test_the_adapter_compiles_against_moveit_where_it_is_installed():
    """The stand-ins above cannot show that MoveIt's classes still look like them."""
    roots = [Path(one) for one in os.environ.get("AMENT_PREFIX_PATH", "").split(":") if one]
    roots += [Path("/opt/ros/jazzy")]
    header = "moveit/planning_interface/planning_response_adapter.hpp"
    if not any((root / "include/moveit_core" / header).exists() for root in roots):
        pytest.skip("no headers of MoveIt: sudo apt install ros-jazzy-moveit-core")
    own = [f"-I{folder}" for root in roots for folder in (root / "include").glob("*")]
    eigen = "-I/usr/include/eigen3"
    subprocess.run(
        ["g++", "-std=c++17", "-fsyntax-only", *own, *includes(), eigen, str(ADAPTER)], check=True
    )
