"""`mbs solve-ik`, `mbs simulate`, `mbs sweep`, `mbs identify`: the numbers of the package."""

import json
from pathlib import Path

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.models import inverse_geometry

LAWS = ("q1.q=0.8*(1 - cos(1.7*t)) + 0.5*sin(2.9*t)^3", "q2.q=0.9*(1 - cos(2.3*t)) - sin(t)^2")


def read_csv(text: str) -> dict[str, np.ndarray]:
    names, *rows = (line.split(",") for line in text.strip().splitlines())
    table = np.array([[float(cell) for cell in row] for row in rows])
    return dict(zip(names, table.T, strict=True))


def test_every_configuration_of_the_pose_of_a_configuration(command) -> None:
    words = ("--q", "q1=0.3", "--q", "q2=0.5", "--q", "q3=pi/3", "--q", "q5=1")
    data = json.loads(command("solve-ik", "rx90", *words, "--json").out)
    system = catalogue_system("rx90")
    T = np.array(mbs.models.direct_geometry(system)([0.3, 0.5, np.pi / 3, 0, 1, 0]))
    np.testing.assert_allclose(data["pose"], T, atol=1e-15)
    expected = inverse_geometry.solve(system, T)
    found = [list(solution["q"].values()) for solution in data["solutions"]]
    assert len(found) == 8
    np.testing.assert_allclose(found, expected.q, atol=1e-12)
    assert data["solutions"][0]["branch"] == expected[0].branch
    assert data["method"] == "pieper"


def test_the_pose_can_be_said_in_three_ways(command) -> None:
    roll = ("--xyz", "0.4", "-0.1", "0.3", "--rpy", "0", "pi/2", "0")
    ways = (roll, ("--pose", "0.4 -0.1 0.3 0 pi/2 0"), ("--pose", "0 0 1 .4 0 1 0 -.1 -1 0 0 .3"))
    answers = [json.loads(command("solve-ik", "puma560", *way, "--json").out) for way in ways]
    found = [[list(s["q"].values()) for s in answer["solutions"]] for answer in answers]
    assert len(found[0]) == 8
    np.testing.assert_allclose(found[1], found[0], atol=1e-9)
    np.testing.assert_allclose(found[2], found[0], atol=1e-9)


def test_loops_are_closed_at_a_configuration(command) -> None:
    data = json.loads(command("solve-ik", "four_bar", "--q", "j1=0.3", "--json").out)
    assert min(abs(solution["q"]["j1"] - 0.3) for solution in data["solutions"]) < 1e-12


def test_a_pose_out_of_reach_is_a_sentence_and_an_exit_code(command) -> None:
    answer = command("solve-ik", "puma560", "--xyz", "5", "0", "0", "--json")
    data = json.loads(answer.out)
    assert answer.code == 1
    assert data["solutions"] == []
    assert data["nearest"]["distance"] > 3
    assert "no solution, out of reach" in answer.err


def test_the_motion_is_that_of_the_package(command, tmp_path: Path) -> None:
    words = ("--duration", "0.2", "--q0", "j1=0.3", "--tau", "j1=5*sin(2*t)", "-o", "motion.csv")
    answer = command("simulate", "four_bar", *words)
    assert answer.code == 0
    assert "closure_residual" in answer.out
    columns = read_csv((tmp_path / "motion.csv").read_text())
    system = catalogue_system("four_bar")
    import casadi

    def tau(t, q, v):
        return casadi.vertcat(5 * casadi.sin(2 * t), 0, 0)

    result = mbs.simulate.run(system, 0.2, q0={"j1": 0.3}, tau=tau)
    assert list(columns) == ["time", *result.names]
    np.testing.assert_array_equal(columns["time"], result.time)
    for name in result.names:
        np.testing.assert_allclose(columns[name], result[name], rtol=1e-9, atol=1e-9)


def test_the_motion_goes_to_the_screen_and_into_pictures(command, tmp_path: Path) -> None:
    short = ("simulate", "planar_2r", "--duration", "0.02")
    columns = read_csv(command(*short, "--output", "-").out)
    data = json.loads(command(*short, "--plot", "m.svg", "--signal", "q1.q", "--json").out)
    assert data["columns"]["q1.q"] == columns["q1.q"].tolist()
    assert data["units"]["q1.tau"] == "N.m"
    assert (tmp_path / "m.svg").read_text().count("<svg") == 1
    command(*short, "--film", "film.html")
    assert "<html" in (tmp_path / "film.html").read_text()


def test_a_study_has_a_line_for_each_case(command, tmp_path: Path) -> None:
    words = ("--over", "q1.q=0:1:0.5", "--over", "q2.tau=0, 5", "--duration", "0.05")
    columns = read_csv(command("sweep", "planar_2r", *words).out)
    np.testing.assert_array_equal(columns["q1.q"], [0, 0, 0.5, 0.5, 1, 1])
    np.testing.assert_array_equal(columns["q2.tau"], [0, 5, 0, 5, 0, 5])
    system = catalogue_system("planar_2r")
    one = mbs.simulate.run(system, 0.05, q0={"q1": 0.5}, tau={"q2": 5.0})
    assert columns["q1.q.end"][3] == pytest.approx(one["q1.q"][-1], abs=1e-12)
    data = json.loads(command("sweep", "planar_2r", *words, "-o", "s.csv", "--json").out)
    assert data["cases"][3]["q1.q.end"] == columns["q1.q.end"][3]
    assert data["failures"] == {}
    assert read_csv((tmp_path / "s.csv").read_text()).keys() == columns.keys()


def test_a_case_that_fails_is_told(command) -> None:
    answer = command("sweep", "planar_2r", "--over", "q1.v=0, 1e200", "--duration", "0.05")
    good, bad = answer.out.strip().splitlines()[1:]
    assert answer.code == 1
    assert not good.endswith(",")
    assert bad.startswith("1e+200,,")
    assert "case 1 failed" in answer.err


def test_the_parameters_are_found_again(command, tmp_path: Path) -> None:
    motions = [word for law in LAWS for word in ("--motion", law)]
    command("simulate", "planar_2r", "--duration", "8", *motions, "--output", "record.csv")
    words = ("--bandwidth", "15", "--residuals", "r.csv", "--output", "e.csv", "--json")
    answer = command("identify", "planar_2r", "record.csv", *words)
    data = json.loads(answer.out)
    found = {row["name"]: row["value"] for row in data["parameters"]}
    assert found["MX1R"] == pytest.approx(1.5, rel=1e-3)
    assert found["MX2"] == pytest.approx(0.5, rel=1e-3)
    assert data["held_out_percent"] < 0.1
    assert (tmp_path / "e.csv").read_text().startswith("name,value,deviation")
    assert "q1.measured" in (tmp_path / "r.csv").read_text()


def test_a_redundant_arm_needs_a_joint_that_stays(command) -> None:
    pose = ("solve-ik", "panda", "--q", "q2=0.4", "--q", "q4=-1.5")
    words = ("--locked", "q3=0", "--seed", "q2=0.4", "--seed", "q4=-1.5", "--json")
    data = json.loads(command(*pose, *words).out)
    nearest = data["solutions"][0]["q"]
    assert nearest["q3"] == 0
    assert nearest["q4"] == pytest.approx(-1.5, abs=1e-9)
    answer = command(*pose, "--method", "pieper")
    assert answer.code == 1
    assert answer.err.startswith("mbs: ")
    data = json.loads(command(*pose, "--redundant", "q7=3", "--json").out)
    assert {row["q"]["q7"] for row in data["solutions"]} <= {-2.8973, 0.0, 2.8973}
    assert len(data["solutions"]) > 2
    wrong = command(*pose, "--redundant", "q7=2.5")
    assert wrong.code == 1
    assert "--redundant q7: 2.5 is no whole number of positions" in wrong.err


def test_of_a_motion_that_stops_what_it_has_is_written(command, tmp_path: Path) -> None:
    words = ("--tau", "q1=sqrt(0.255 - t)", "--output", str(tmp_path / "part.csv"))
    said = command("simulate", "planar_2r", *words)
    assert said.code == 1
    assert "integration stopped at t = 0.255 s" in said.err
    assert "stopped" not in said.out
    table = read_csv((tmp_path / "part.csv").read_text(encoding="utf-8"))
    np.testing.assert_allclose(table["time"], np.arange(26) / 100)
