"""A small robot on a rail, with its kinematics written down by hand."""

from __future__ import annotations

import math

import numpy as np

UPPER, FORE, CUP = 0.5, 0.4, 0.1
JOINTS = ("rail", "shoulder", "elbow", "wrist")
RAIL_URDF = f"""<robot name="rail_robot">
  <link name="world"/><link name="carriage"/><link name="upper"/><link name="fore"/>
  <link name="hand"/><link name="cup"/><link name="jaw"/><link name="other_jaw"/>
  <joint name="rail" type="prismatic"><parent link="world"/><child link="carriage"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1" velocity="3"/></joint>
  <joint name="shoulder" type="revolute"><parent link="carriage"/><child link="upper"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="9"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/>
    <origin xyz="{UPPER} 0 0"/><axis xyz="0 0 1"/></joint>
  <joint name="wrist" type="revolute"><parent link="fore"/><child link="hand"/>
    <origin xyz="{FORE} 0 0"/><axis xyz="1 0 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="9"/></joint>
  <joint name="grip" type="fixed"><parent link="hand"/><child link="cup"/>
    <origin xyz="0 0 {CUP}"/></joint>
  <joint name="jaw" type="prismatic"><parent link="hand"/><child link="jaw"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.1" effort="1" velocity="1"/></joint>
  <joint name="other_jaw" type="prismatic"><parent link="hand"/><child link="other_jaw"/>
    <axis xyz="0 1 0"/><limit lower="-0.1" upper="0" effort="1" velocity="1"/>
    <mimic joint="jaw" multiplier="-1"/></joint>
</robot>"""


def cup_position(rail, shoulder, elbow, wrist=0.0):
    """Where the cup stands for positions of the joints [m]; arrays give (N, 3)."""
    toward = shoulder + elbow
    side, up = -CUP * np.sin(wrist), CUP * np.cos(wrist)
    return np.stack(
        [
            UPPER * np.cos(shoulder) + FORE * np.cos(toward) - side * np.sin(toward),
            rail + UPPER * np.sin(shoulder) + FORE * np.sin(toward) + side * np.cos(toward),
            up + 0.0 * toward,
        ],
        axis=-1,
    )


def swung(t, seconds: float = 2.0):
    """(N, 4) positions of JOINTS at times t [s]: at rest before 0 and behind `seconds`."""
    x = np.clip(np.asarray(t) / seconds, 0.0, 1.0)
    ease = x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3)
    return np.stack([0.5 * ease, 0.9 * ease - 0.4, 0.3 - 1.2 * ease, 0.0 * ease], axis=-1)


def acceleration(t, step: float = 1e-4):
    """(N, 3) of the cup [m/s²], by differences of the kinematics."""
    places = [cup_position(*swung(np.asarray(t) + k * step).T) for k in (-1, 0, 1)]
    return (places[0] - 2.0 * places[1] + places[2]) / step**2


def quaternion(shoulder: float, elbow: float, wrist: float) -> tuple[float, float, float, float]:
    """Attitude world ← cup."""
    yaw, half = 0.5 * (shoulder + elbow), 0.5 * wrist
    return (
        math.cos(yaw) * math.sin(half), math.sin(yaw) * math.sin(half),
        math.sin(yaw) * math.cos(half), math.cos(yaw) * math.cos(half),
    )  # fmt: skip
