"""Tests `slosh demo --model`: a paper cup through all nodes, replayed bit for bit."""

import json
import os
import subprocess
import sys

import pytest

CUP = """
container:
  {shape: frustum, bottom_radius: 0.028, top_radius: 0.04, height: 0.092, fill_height: 0.065}
modes:
- {axis: x, natural_frequency: 21.49, reach: 0.03648, mass_ratio: 0.3,
  height_per_displacement: 1.49, mass_height: -0.03, crest_ratio: 1.0, crest_place: 0.03648,
  layer_damping: 7.0, bulk_damping: 200.0}
effects: [{name: vertical_acceleration}]
"""


@pytest.mark.long
def test_a_paper_cup_is_replayed_bit_for_bit(tmp_path):
    (tmp_path / "cup.yaml").write_text(CUP)
    environment = {name: value for name, value in os.environ.items() if name != "ROS_DOMAIN_ID"}
    command = [sys.executable, "-m", "slosh_bringup.cli", "demo", "--motion", "l", "--json"]
    done = subprocess.run(
        [*command, "--model", str(tmp_path / "cup.yaml"), "-o", str(tmp_path / "out")],
        capture_output=True,
        text=True,
        timeout=250,
        check=False,
        env=environment,
    )
    assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / "out" / "latest" / "result.json").read_text())
    checks = {one["name"].split()[1].strip(","): one for one in result["verifications"]}
    assert all(one["same"] == one["total"] for one in checks.values())
    assert checks["estimates"]["total"] > 1000
    # The simulated camera sees the cup.
    assert checks["comparisons"]["total"] > 100
    camera = next(one for one in result["agreements"] if one["name"] == "camera / truth")
    assert camera["rms"] < 5e-4
    # The recording brings the modes along: its replay solves nothing.
    assert "natural_frequency: 21.49" in result["model_text"]
    assert result["nonlinear_name"] == "3D-L"
