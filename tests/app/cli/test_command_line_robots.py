"""`mbs robots`, `mbs show`, `mbs models`: what there is, in numbers that the package gives."""

import json

import pytest

import mbs
from mbs.app.cli.structure import structure
from mbs.models.catalogue import entries

KINDS = {
    "puma560": ("serial", 6, 6, 0),
    "two_branch_tree": ("tree", 7, 7, 0),
    "flyball_governor": ("tree", 4, 4, 0),
    "four_bar": ("closed", 4, 4, 1),
    "bricard": ("closed", 6, 6, 1),
    "whipple_bicycle": ("closed", 11, 9, 2),
    "stewart_platform": ("closed", 18, 36, 5),
    "differential_wrist": ("closed", 6, 6, 4),
}


def test_robots_lists_the_catalogue(command) -> None:
    rows = json.loads(command("robots", "--json").out)
    assert [row["name"] for row in rows] == list(mbs.robots.catalogue())
    known = {row["name"]: row for row in rows}
    for name, (kind, joints, dofs, loops) in KINDS.items():
        row = known[name]
        assert (row["kind"], row["joints"], row["dofs"], row["loops"]) == (
            kind,
            joints,
            dofs,
            loops,
        )
    assert known["four_bar"]["source"] == mbs.robots.four_bar().source
    table = command("robots").out
    assert all(name in table for name in known)


@pytest.mark.parametrize("name", ["sr400", "whipple_bicycle"])
def test_the_structure_is_that_of_the_assembled_system(name: str) -> None:
    system = mbs.load(name).assemble()
    found = structure(mbs.load(name))
    cut = sum(cut.edge.joint.nv for cut in system.cuts)
    assert found.loops == len(system.loops)
    assert found.dofs == system.nv + cut
    assert (found.kind == "closed") is system.is_closed


def test_mobility_is_that_of_the_assembled_systems(command, monkeypatch) -> None:
    few = {name: mbs.robots.catalogue()[name] for name in ("four_bar", "planar_2r")}
    monkeypatch.setattr("mbs.robots.catalogue", lambda: few)
    rows = json.loads(command("robots", "--mobility", "--json").out)
    assert {row["name"]: row["mobility"] for row in rows} == {"four_bar": 1, "planar_2r": 2}


def test_show_gives_the_tables_of_the_system(command) -> None:
    system = mbs.load("sr400").assemble()
    data = json.loads(command("show", "sr400", "--json").out)
    assert (data["nq"], data["nv"], data["closed"]) == (system.nq, system.nv, True)
    assert data["gravity"] == [0.0, 0.0, -9.81]
    for row, link in zip(data["links"], system.links, strict=True):
        assert (row["name"], row["antecedent"], row["d"]) == (link.name, link.antecedent, link.d)
    for row, link in zip(data["inertia"], system.tree.links, strict=True):
        assert row["M"] == float(link.inertia.parameters[9])
    assert [row["configuration"] for row in data["coordinates"]] == list(system.configuration)
    assert data["independent"] == [system.velocity_coordinates[k].name for k in system.independent]
    assert data["report"] == system.report()
    text = command("show", "sr400").out
    assert "Inertial parameters" in text
    assert system.report() in text


def test_show_keeps_symbols_and_takes_their_values(command, tmp_path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(
        'name = "arm"\nparameters = { L2 = 0.45 }\n'
        "[[frame]]\nantecedent = 0\n"
        '[[frame]]\nantecedent = 1\nd = "L2/2"\n'
        "[[body]]\nframe = 2\nM = 2\nXX = 0.1\nYY = 0.1\nZZ = 0.1\n"
    )
    data = json.loads(command("show", str(path), "-p", "L2=pi/8", "--json").out)
    assert data["symbols"][0]["name"] == "L2"
    assert data["symbols"][0]["value"] == pytest.approx(0.39269908169872414, abs=1e-15)
    assert isinstance(data["links"][1]["d"], str)
    assert "L2" in data["links"][1]["d"]
    assert "Symbols" in command("show", str(path)).out


def test_models_of_a_robot_are_those_that_it_has(command) -> None:
    every = [row["key"] for row in json.loads(command("models", "--json").out)]
    assert {entry.key for entry in entries()} < set(every)
    system = mbs.load("planar_2r").assemble()
    rows = json.loads(command("models", "planar_2r", "--json").out)
    keys = [row["key"] for row in rows]
    assert {e.key for e in entries() if not e.refusal(system)} <= set(keys)
    assert "closure" in every
    assert "closure" not in keys
    jacobian = next(row for row in rows if row["key"] == "jacobian")
    frame = next(option for option in jacobian["options"] if option["name"] == "frame")
    assert frame["default"] == 2
    assert "jacobian" in command("models").out


HUNG = ("--gravity", "0,0,-1.62", "--mount", "x=pi", "--mount", "position=0,0,2.5")


def test_gravity_and_mount_of_a_robot(command, tmp_path) -> None:
    shown = json.loads(command("show", "rx90", *HUNG, "--json").out)
    assert [float(x) for x in shown["gravity"]] == pytest.approx([0, 0, 1.62], abs=1e-15)
    words = ("rx90", "--duration", "0.1", "--json")
    moved = json.loads(command("simulate", *words, *HUNG).out)
    system = mbs.load("rx90", gravity=(0, 0, 1.62)).assemble()
    result = mbs.simulate.run(system, 0.1)
    assert moved["columns"]["q2.q"][-1] == pytest.approx(result["q2.q"][-1], abs=1e-9)
    assert command("convert", "rx90", "hung.toml", *HUNG).code == 0
    assert [float(str(x)) for x in mbs.load(tmp_path / "hung.toml").gravity] == pytest.approx(
        [0, 0, 1.62], abs=1e-15
    )


@pytest.mark.parametrize(
    "words",
    [
        ("model", "planar_2r", "gravity"),
        ("count", "planar_2r", "gravity"),
        ("export", "toml", "planar_2r", "a.toml"),
        ("export", "par", "planar_2r", "a.par"),
        ("sweep", "planar_2r", "--over", "q1.q=0,1", "--duration", "0.1"),
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_commands_take_gravity_and_mount(command, words) -> None:
    assert command(*words, "--mount", "x=pi").code == 0
    answer = command(*words, "--gravity", "9.81")
    assert answer.code == 1
    assert "--gravity: '9.81' has not three values; write them as 0,0,-9.81" in answer.err
