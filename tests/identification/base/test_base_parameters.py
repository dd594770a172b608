"""The result: names, equations, function, the system in base parameters, errors."""

import importlib

import numpy as np
import pytest
from support.base_counts import TX40
from support.base_robots import table

import mbs
from mbs.errors import ModelError
from mbs.formats import read_par, write_toml
from mbs.identification import base_parameters, columns_of, numeric_parameters
from mbs.identification.grouping.grouping import Grouping
from mbs.operations import count
from mbs.spatial.inertia import TEN_PARAMETERS

STATES = 6


@pytest.fixture(scope="module")
def puma():
    return mbs.load("puma560").assemble()


@pytest.fixture(scope="module")
def symbolic():
    """TX40 with symbols for lengths, gravity and all parameters."""
    rows = table("tx40", TX40, gravity=(0, 0, "-G3"))
    rows["frame"] = [dict(frame) for frame in rows["frame"]]
    rows["frame"][2] |= {"d": "D3", "r": "R3"}
    rows["frame"][3] |= {"r": "RL4"}
    names = (*TEN_PARAMETERS, "Ia", "Fv", "Fs")
    rows["body"] = [
        {"frame": j, "grouped": True, **{name: f"{name}{j}" for name in names}} for j in range(1, 7)
    ]
    rows["parameters"] = {"D3": 0.225, "R3": 0.035, "RL4": 0.225, "G3": 9.81}
    return mbs.load(rows).assemble()


def test_equations_with_symbols_of_lengths(symbolic):
    base = base_parameters(symbolic)
    assert base.count == 52
    assert base.check.agrees
    assert "MX2R = MX2 + D3*M3 + D3*M4 + D3*M5 + D3*M6" in base.equations
    assert "MY3R = MY3 - MZ4 - RL4*M4 - RL4*M5 - RL4*M6" in base.equations
    assert "XX4R = XX4 - YY4 + YY5" in base.equations
    assert "XX3R = XX3 - YY3 + YY4 + 2*RL4*MZ4 + RL4^2*M4 + RL4^2*M5 + RL4^2*M6" in base.equations
    assert [column.name for column in base.without_effect] == [
        *("XX1", "XY1", "XZ1", "YY1", "YZ1", "MX1", "MY1", "MZ1", "M1"),
        *("MZ2", "M2"),
    ]


def test_function_and_matrix_agree_with_the_equations(symbolic):
    base = base_parameters(symbolic)
    K = np.random.default_rng(0).uniform(-1, 1, len(base.columns))
    p = [1.0 if x is None else x for x in (q.default for q in symbolic.parameters)]
    assert np.array(base.function(K, p)).ravel() == pytest.approx(base.matrix @ K, abs=1e-14)
    row = base.names.index("MX2R")
    names = [column.name for column in base.columns]
    expected = K[names.index("MX2")] + 0.225 * sum(K[names.index(f"M{j}")] for j in (3, 4, 5, 6))
    assert (base.matrix @ K)[row] == pytest.approx(expected, abs=1e-14)
    assert base.matrix[:, base.indices] == pytest.approx(np.eye(base.count), abs=0)


def test_models_of_the_system_in_base_parameters(symbolic):
    fewer = base_parameters(symbolic).apply()
    rng = np.random.default_rng(1)
    p = rng.uniform(0.2, 1, len(symbolic.parameters))
    for builder in (mbs.models.inverse_dynamics, mbs.models.direct_dynamics):
        full, cheap = builder(symbolic), builder(fewer)
        for _ in range(STATES):
            state = rng.uniform(-2, 2, (3, 6))
            expected = np.array(full(*state, p))
            scale = 1 + np.abs(expected).max()
            assert np.array(cheap(*state, p)) == pytest.approx(expected, abs=1e-10 * scale)


def test_operations_of_the_puma_in_base_parameters(puma):
    found = count(mbs.models.inverse_dynamics(base_parameters(puma).apply()))
    assert found.mul + found.div <= 314
    assert found.add <= 253


@pytest.mark.parametrize("name", ["puma560", "two_branch_tree", "sr400"])
def test_written_as_robot_files_and_read_again(name, tmp_path):
    """Also where grouped parameters are such as no body can have."""
    system = mbs.load(name).assemble()
    base = base_parameters(system)
    files = tmp_path / "grouped.par", tmp_path / "grouped.toml"
    mbs.export.par(base.apply(), files[0])
    write_toml(read_par(files[0]), files[1])
    q = np.array(system.configuration)
    v, a = np.random.default_rng(2).uniform(-2, 2, (2, len(system.independent)))
    expected = np.array(mbs.models.inverse_dynamics(system)(q, v, a))
    for path in files:
        again = mbs.load(path).assemble()
        found = np.array(mbs.models.inverse_dynamics(again)(q, v, a))
        assert found == pytest.approx(expected, abs=1e-10 * np.abs(expected).max())
        columns = columns_of(again, friction=False)
        used = [c for c, x in zip(columns, numeric_parameters(again, columns), strict=True) if x]
        assert (
            len(used) <= base_parameters(system, columns=columns_of(system, friction=False)).count
        )


def test_an_order_keeps_what_is_wanted(puma):
    columns = columns_of(puma, rotors=False, friction=False)
    base = base_parameters(puma, "numeric", order=["YY2", "M3"], columns=columns)
    assert base.count == 36
    names = [column.name for column in base.kept]
    assert "YY2" in names
    assert "M3" in names
    assert base.check.error < 1e-9


def test_offsets_and_motors_of_two_joints_have_columns_of_their_own(puma):
    columns = columns_of(puma, offsets=True, couplings=[(6, 5)])
    base = base_parameters(puma, columns=columns)
    assert base.count == base.check.rank == 61
    assert {"offset1", "Iam6", "Fvm6", "Fsm6"} <= {column.name for column in base.kept}


def test_a_symbol_that_vanishes_at_its_default_is_told(puma):
    rows = table("elbow", [{"antecedent": 0}, {"antecedent": 1, "alpha": "A"}])
    rows["frame"] = [{"joint": "revolute", **frame} for frame in rows["frame"]]
    rows["parameters"] = {"A": 0.0}
    base = base_parameters(mbs.load(rows).assemble())
    assert not base.check.agrees
    assert not base.check.applied
    assert base.count > base.check.rank
    assert "at the defaults of the symbols only" in base.check.text


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"method": "qr"}, "method is 'qr'; use 'symbolic' or 'numeric'"),
        ({"order": ["ZZ1"]}, "use method='numeric'"),
        ({"method": "numeric", "order": ["ZZ9"]}, "the order names 'ZZ9'"),
    ],
)
def test_errors(puma, arguments, told):
    with pytest.raises(ModelError) as error:
        base_parameters(puma, **arguments)
    assert told in str(error.value)


def test_a_grouping_that_holds_at_the_defaults_alone_is_told(symbolic, monkeypatch):
    module = importlib.import_module("mbs.identification._base_parameters")
    rules = module.grouped_by_rules

    def bent(system, *arguments):
        grouping = rules(system, *arguments)
        default = next(q.default for q in system.parameters if q.default is not None)
        place = next(k for k, q in enumerate(system.parameters) if q.default is not None)
        wrong = 1 + system.p[place] - default
        kept = set(grouping.kept)
        return Grouping(
            tuple(
                terms if k in kept else {i: x * wrong for i, x in terms.items()}
                for k, terms in enumerate(grouping.columns)
            )
        )

    monkeypatch.setattr(module, "grouped_by_rules", bent)
    base = base_parameters(symbolic)
    assert not base.check.agrees
    assert "At other values of the symbols than their defaults: The rules" in base.check.text
