"""Tests `slosh predict`: output, exit codes and errors."""

import html
import json
import math
from pathlib import Path

import numpy as np
import pytest

from slosh_bringup.cli.main import main
from slosh_bringup.processes import config_folder
from slosh_model.motion_profiles import quintic
from slosh_motion.inputs.robot import available

MODEL = str(config_folder() / "model.yaml")


def line(path, duration=1.0, *, poses=False, count=501):
    t = np.linspace(0.0, duration, count)
    position, _, acceleration = quintic(t / duration)
    along = 0.4 * (position if poses else acceleration / duration**2)
    rows = np.column_stack([t, along, np.zeros((count, 2))])
    heading = "t,x,y,z" if poses else "t,ax,ay,az"
    np.savetxt(path, rows, "%.12g", ",", header=heading, comments="")
    return str(path)


def answers(capsys, *words):
    code = main(["predict", MODEL, *words, "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_an_exceeded_limit_is_exit_code_one_and_a_safe_scale(capsys, tmp_path):
    motion = line(tmp_path / "a.csv")
    code, (found,) = answers(capsys, motion, "--limit", "0.01", "--residual", "0.002")
    assert code == 1
    assert not found["kept"]
    assert found["excess"] == pytest.approx(found["peak_nonlinear"] - 0.01)
    slow = line(tmp_path / "slow.csv", 1.001 * found["time_scale"])
    code, (kept,) = answers(capsys, slow, "--limit", "0.01", "--residual", "0.002")
    assert (code, kept["kept"]) == (0, True)
    assert kept["time_scale"] == pytest.approx(1.0 / 1.001, rel=1e-3)


def test_what_is_known_of_the_error_counts(capsys, tmp_path):
    motion = line(tmp_path / "a.csv", 2.0)
    _, (plain,) = answers(capsys, motion)
    limit = str(plain["peak_nonlinear"] + 0.001)
    assert answers(capsys, motion, "--limit", limit)[0] == 0
    code, (unsure,) = answers(capsys, motion, "--limit", limit, "--sigma", "0.001")
    assert code == 1
    assert unsure["excess"] == pytest.approx(0.001)


def test_people_get_a_table_and_programs_a_file(capsys, tmp_path):
    motion, output = line(tmp_path / "a.csv"), tmp_path / "out.csv"
    assert main(["predict", MODEL, motion, motion, "--limit", "0.01", "-o", str(output)]) == 1
    heading, *rows = capsys.readouterr().out.splitlines()
    assert heading.split("  ")[0].strip() == "motion"
    for word in ("peak [mm]", "linear peak [mm]", "azimuth [deg]", "residual [mm]"):
        assert word in heading
    assert len(rows) == 2
    assert "above the limit" in rows[0]
    table = np.genfromtxt(output, delimiter=",", names=True)
    assert table["peak_nonlinear"][0] > 0.01
    assert table["time_scale"][0] > 1.0


def test_motions_are_shown_side_by_side_in_words(capsys, tmp_path):
    fast, slow = line(tmp_path / "fast.csv", 0.7), line(tmp_path / "slow.csv", 2.0)
    picture, page = tmp_path / "both.svg", tmp_path / "both.html"
    words = ["--limit", "0.01", "--plot", str(picture), "--page", str(page)]
    code, facts = answers(capsys, fast, slow, *words)
    assert code == 1
    drawn, shown = picture.read_text(), page.read_text()
    assert "1 of 2 motions within their limits" in shown
    for one in facts:
        peak, linear = (f"{1e3 * one[f'peak_{k}']:.1f} mm" for k in ("nonlinear", "linear"))
        for text in (drawn, shown):
            assert Path(one["trajectory"]).name in text
            for said in (f"peak {peak} at", f"linear peak {linear}", "azimuth ", "residual "):
                assert said in text
    assert "limit 10.0 mm" in drawn
    assert shown.count("<svg") == 4
    assert main(["predict", MODEL, fast, "--plot", str(tmp_path / "a.jpg")]) == 2
    assert "must end in .png or .svg" in capsys.readouterr().err


def test_the_page_has_the_remarks_of_the_table(capsys, tmp_path):
    fast, page = line(tmp_path / "fast.csv", 0.5), tmp_path / "fast.html"
    code, (facts,) = answers(capsys, fast, "--limit", "0.01", "--page", str(page))
    assert code == 1
    assert main(["predict", MODEL, fast, "--limit", "0.01"]) == 1
    table = capsys.readouterr().out
    assert any("above the limit" in remark for remark in facts["remarks"])
    assert any("beyond" in remark or "lost" in remark for remark in facts["remarks"])
    for remark in facts["remarks"]:
        assert remark in table
        assert remark in html.unescape(page.read_text())


def test_the_page_tells_what_is_doubtful_in_the_input(capsys, tmp_path):
    path, page = tmp_path / "in_g.csv", tmp_path / "in_g.html"
    rows = [f"{0.01 * n:.2f},0,0,1" for n in range(101)]
    path.write_text("\n".join(["t,ax,ay,az", *rows]) + "\n")
    main(["predict", MODEL, str(path), "--page", str(page)])
    (warning,) = capsys.readouterr().err.splitlines()[:1]
    assert warning.rpartition("in_g.csv: ")[2] in html.unescape(page.read_text())


def test_no_limit_left_is_no_safe_scale(capsys, tmp_path):
    motion = line(tmp_path / "a.csv")
    assert main(["predict", MODEL, motion, "--limit", "0.01", "--sigma", "0.01"]) == 1
    assert "no safe time scale" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "options", "match"),
    [
        ("t,ax,ay,az\n0,0,0,0\n", "", "1 point: a motion needs at least 2"),
        ("t,ax,ay,az\n0,0,0,0\n0.2,0,0,0\n0.1,0,0,0\n", "", "t[2] = 0.1 s comes before"),
        ("t,x,y,z\n0,0,0,0\n0.1,nan,0,0\n0.2,0,0,0\n", "", "position[1].x = nan is not finite"),
        ("t,x,y\n0,0,0\n", "", "column 'z' is missing; x, y, z belong together"),
        ("t,wx,wy,wz\n0,0,0,0\n", "", "a planned motion needs t, and ax,ay,az or x,y,z"),
        ("t,ax,ay,az,speed\n0,0,0,0,0\n", "", "column 'speed' is unknown"),
        ("t,ax,ay,az\n0,0,0,0\n0.1,1,0,0\n", "--limit -1", "height limit = -1.0 m must lie above"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line_and_exit_code_two(capsys, tmp_path, text, options, match):
    path = tmp_path / "m.csv"
    path.write_text(text)
    assert main(["predict", MODEL, str(path), *options.split()]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (said,) = captured.err.strip().split("\n")
    assert match in said


URDF = """<robot name="slide">
  <link name="rail"/><link name="cup"/>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="cup"/>
    <axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="9"/></joint>
</robot>"""


@pytest.mark.skipif(not available(), reason="no Pinocchio (requirements/joints.txt)")
def test_motions_of_joints_by_a_robots_description(capsys, tmp_path):
    t = np.linspace(0.0, 1.0, 501)
    rows = np.column_stack([t, 0.4 * quintic(t)[0]])
    np.savetxt(tmp_path / "j.csv", rows, "%.12g", ",", header="t,slide", comments="")
    (tmp_path / "slide.urdf").write_text(URDF)
    robot = ["--urdf", str(tmp_path / "slide.urdf"), "--tool-frame", "cup"]
    code, (found,) = answers(capsys, str(tmp_path / "j.csv"), *robot)
    assert code == 0
    _, (same,) = answers(capsys, line(tmp_path / "a.csv"))
    assert found["peak_nonlinear"] == pytest.approx(same["peak_nonlinear"], rel=1e-3)
    assert main(["predict", MODEL, line(tmp_path / "a.csv"), *robot]) == 2
    assert "has no moving joint 'ax' (it has slide)" in capsys.readouterr().err


def test_a_robot_needs_its_tool_frame(capsys, tmp_path):
    motion = line(tmp_path / "a.csv")
    assert main(["predict", MODEL, motion, "--urdf", "robot.urdf"]) == 2
    assert (
        capsys.readouterr().err.strip().endswith("--urdf and --tool-frame must be given together")
    )


def test_a_table_whose_accelerations_contradict_its_positions_is_refused(capsys, tmp_path):
    t = np.linspace(0.0, 1.0, 501)
    position, _, acceleration = quintic(t)
    still = np.zeros((len(t), 2))
    table = tmp_path / "both.csv"
    head = "t,x,y,z,ax,ay,az"

    def write(factor):
        rows = np.column_stack([t, 0.4 * position, still, factor * 0.4 * acceleration, still])
        np.savetxt(table, rows, "%.12g", ",", header=head, comments="")

    write(1.0)
    assert answers(capsys, str(table))[0] == 0
    for factor in (0.0, 100.0):
        write(factor)
        assert main(["predict", MODEL, str(table)]) == 2
        said = capsys.readouterr().err
        assert f"{table}: positions and accelerations contradict each other" in said


def test_of_a_tray_the_worst_container_is_named(capsys, tmp_path):
    """The worst container is named by its own limit; the page shows a single container."""
    tray, motion = tmp_path / "tray.yaml", line(tmp_path / "a.csv", 2.0)
    cups = [f"- {{name: {name}, model: {MODEL}, limit: {limit}}}\n" for name, limit in LIMITS]
    tray.write_text("containers:\n" + "".join(cups))
    assert main(["predict", str(tray), motion, "--json"]) == 1
    (found,) = json.loads(capsys.readouterr().out)
    assert (found["container"], found["height_limit"], found["kept"]) == ("low", 0.002, False)
    assert list(found["containers"]) == ["high", "low"]
    assert found["time_scale"] > 1.0
    main(["predict", str(tray), motion])
    assert "worst container low (high " in capsys.readouterr().out
    assert main(["predict", str(tray), motion, "--page", str(tmp_path / "p.html")]) == 2
    assert "give its model, no tray" in capsys.readouterr().err
    assert main(["simulate", str(tray), motion, "-o", str(tmp_path / "o.csv")]) == 2
    assert "a tray of containers" in capsys.readouterr().err


def answer(words):
    """Runs `slosh predict`; returns its exit code, also if an option cannot be parsed."""
    try:
        return main(words)
    except SystemExit as stop:
        return stop.code


def test_limits_for_a_gantry_are_numbers_and_lines_of_a_protocol(capsys, tmp_path):
    assert main(["predict", MODEL, "--limit", "0.01", "--gantry", "5", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert 0.0 < found["acceleration"] < found["smooth_acceleration"]
    assert main(["predict", MODEL, "--limit", "0.01", "--gantry", "5"]) == 0
    said = capsys.readouterr().out
    assert f"pipette.default_speed = {math.floor(1e3 * found['speed'])}  # mm/s" in said
    assert f"protocol.delay(seconds={math.ceil(found['wait'])})" in said
    for words, told in (
        (["--gantry", "-3"], "--gantry -3: an acceleration above 0 is needed"),
        (["--gantry", "5000"], "did you mean 5000 mm/s2, 5?"),
        (["--gantry", "300mm/s"], "unknown unit 'mm/s'"),
        (["--gantry", "--plot", "a.png"], "--output, --plot and --page do not go with it"),
        (["--gantry", "--mae", "0.006"], "the model's error, 12 mm (2 MAE), is not below"),
        ([], "missing: TRAJECTORY; slosh help predict"),
    ):
        assert answer(["predict", MODEL, "--limit", "0.01", *words]) == 2
        assert told in capsys.readouterr().err


def test_limits_for_a_gantry_count_the_models_error_and_the_lower_limit(capsys):
    def told(*words):
        assert main(["predict", MODEL, "--limit", "10mm", "--gantry", *words]) == 0
        return capsys.readouterr().out

    assert "below 10 mm" in told("--residual", "20mm")
    sure, unsure = (json.loads(told("--json", *words)) for words in ([], ["--epsilon", "0.2"]))
    assert unsure["acceleration"] == pytest.approx(sure["acceleration"] / 1.2, rel=0.02)


def test_a_cup_that_slides_is_named_and_fails(capsys, tmp_path):
    tray, motion = tmp_path / "tray.yaml", line(tmp_path / "a.csv", 2.0)
    standing = "standing: {mass: 0.1, centre_height: 0.05, base_radius: 0.03, friction: %s}"
    for friction, code, word in ((1.0, 0, "stands"), (0.01, 1, "slides")):
        tray.write_text(f"containers:\n- {{name: a, model: {MODEL}, {standing % friction}}}\n")
        assert main(["predict", str(tray), motion, "--limit", "0.1"]) == code
        assert f"a {word}: " in capsys.readouterr().out
    main(["predict", str(tray), motion, "--json"])
    (found,) = json.loads(capsys.readouterr().out)
    assert found["standing"]["a"]["friction"] > 1.0


LIMITS = (("high", 0.05), ("low", 0.002))


@pytest.mark.parametrize(("rate", "code"), [(5, 1), (10, 1), (20, 1), (100, 0)])
def test_predict_and_simulate_read_a_table_alike(capsys, tmp_path, rate, code):
    t = np.arange(rate + 1) / rate
    along = 0.1 / 0.25 * quintic(np.clip(t / 0.5, 0.0, 1.0))[2]
    rows = np.column_stack([t, along, np.zeros((len(t), 2))])
    table = tmp_path / "stroke.csv"
    np.savetxt(table, rows, "%.12g", ",", header="t,ax,ay,az", comments="")
    _, (free,) = answers(capsys, str(table))
    limit = str(free["peak_nonlinear"] + 1e-4)
    found, (said,) = answers(capsys, str(table), "--limit", limit)
    simulated = main(["simulate", MODEL, str(table), "-o", str(tmp_path / "h.csv"), "--json",
                      "--limit", limit])  # fmt: skip
    other = json.loads(capsys.readouterr().out)
    assert found == simulated == code
    assert other["over_limit"] is bool(code)
    assert other["peak"] == pytest.approx(said["peak_nonlinear"], rel=1e-9)
    if rate > 5:
        assert other["peak_upper"] == pytest.approx(said["peak_upper"], rel=1e-9)
