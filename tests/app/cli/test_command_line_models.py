"""`mbs model` and `mbs count`: texts and operations that the package itself gives."""

import json
from pathlib import Path

import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.operations import count, simplify


@pytest.fixture(scope="module")
def puma():
    return catalogue_system("puma560")


def test_the_text_is_that_of_the_simplified_model(command) -> None:
    idm = simplify(mbs.models.inverse_dynamics(catalogue_system("planar_2r")))
    answer = command("model", "planar_2r", "idm", "--language", "fortran")
    assert answer.code == 0
    assert answer.out == mbs.export.code(idm, "fortran")
    counted = count(idm)
    assert f"{counted.mul} multiplications, {counted.add} additions" in answer.err


def test_without_the_optimizer_the_text_is_that_of_the_model(command, puma) -> None:
    answer = command("model", "puma560", "gravity", "-l", "matlab", "--no-optimise")
    assert answer.out == mbs.export.code(mbs.models.gravity_effort(puma), "matlab")


def test_options_reach_the_model(command, puma) -> None:
    words = ("--option", "frame=4", "--option", "expressed_in=3", "-l", "python")
    jacobian = simplify(mbs.models.jacobian(puma, 4, expressed_in=3))
    answer = command("model", "puma560", "jacobian", *words, "--json")
    data = json.loads(answer.out)
    assert data["text"] == mbs.export.code(jacobian, "python")
    assert data["options"]["frame"] == 4
    assert data["after"]["mul"] == count(jacobian).mul
    assert data["inputs"][0].startswith("q ")


def test_words_and_files(command, tmp_path: Path) -> None:
    command("model", "planar_2r", "base-parameters", "-l", "words", "--output", "base.txt")
    text = (tmp_path / "base.txt").read_text()
    assert "ZZ1R = ZZ1 + Ia1 + M2" in text
    answer = command("model", "planar_2r", "dgm", "--output", "dgm.c")
    assert answer.out == ""
    assert (tmp_path / "dgm.c").read_text().startswith("/*")


def test_counts_are_those_of_the_package(command, puma) -> None:
    rows = json.loads(command("count", "puma560", "idm", "gravity", "--json").out)
    models = {
        "idm": mbs.models.inverse_dynamics(puma),
        "gravity": mbs.models.gravity_effort(puma),
    }
    assert [row["key"] for row in rows] == list(models)
    for row, model in zip(rows, models.values(), strict=True):
        for part, counted in (("before", count(model)), ("after", count(simplify(model)))):
            numbers = (counted.mul, counted.add, counted.div, counted.trig, counted.total)
            kinds = ("mul", "add", "div", "trig", "total")
            assert tuple(row[part][kind] for kind in kinds) == numbers
    table = command("count", "puma560", "idm", "--no-optimise").out
    assert str(count(models["idm"]).mul) in table
    assert "after" not in table


def test_the_usual_models_are_counted_when_none_is_named(command) -> None:
    rows = json.loads(command("count", "simple_pendulum", "--no-optimise", "--json").out)
    assert [row["key"] for row in rows] == [
        *("dgm", "jacobian", "idm", "lagrange", "inertia", "bias", "gravity", "ddm")
    ]
    every = command("count", "simple_pendulum", "--no-optimise", "--all", "--json")
    assert len(json.loads(every.out)) > len(rows)
    assert every.code == 0


def test_options_reach_the_counted_model(command) -> None:
    words = ("planar_2r", "jacobian", "--no-optimise", "--option", "frame=1", "--json")
    [row] = json.loads(command("count", *words).out)
    system = catalogue_system("planar_2r")
    here = count(mbs.models.jacobian(system, 1))
    base = count(mbs.models.jacobian(system, 2))
    assert (row["before"]["mul"], row["before"]["total"]) == (here.mul, here.total)
    assert here.total != base.total
