"""Numbers of a system that become parameters."""

import numpy as np
import pytest

import mbs
from mbs.assembly import symbolic
from mbs.components import AbsoluteSensor, Body, Fixed, Revolute, WrenchSensor
from mbs.errors import ModelError

TENSOR = ((0.02, 0.001, 0), (0.001, 0.03, 0.002), (0, 0.002, 0.04))


def arm(d=0.4, r=0.1, M=2.0, XX=0.3, Fv=0.2, g=-9.81):
    """Three links whose numbers are given."""
    rows = [
        {"antecedent": 0, "joint": "revolute", "r": 0.3},
        {"antecedent": 1, "joint": "revolute", "alpha": "pi/2", "d": d, "r": r},
        {"antecedent": 2, "joint": "prismatic", "alpha": "-pi/2", "d": 0.2},
    ]
    bodies = [
        {"frame": 1, "ZZ": 0.5, "Fs": 0.1, "Ia": 0.05},
        {"frame": 2, "XX": XX, "YY": 0.2, "ZZ": 0.4, "MX": 0.3, "M": M, "Fv": Fv},
        {"frame": 3, "XX": 0.1, "YY": 0.1, "ZZ": 0.1, "MZ": 0.2, "M": 1.0, "Ia": 0.3},
    ]
    table = {"name": "arm", "gravity": [0, 0, g], "frame": rows, "body": bodies}
    return mbs.load(table).assemble()


def four_bar(length=1.0, mass=1.5):
    """A four-bar whose coupler has this length, its centre of mass where it is."""
    m = mbs.Mechanism("four_bar", gravity=(0, -9.81, 0))
    a, b, c = (
        m.add(Body(n, mass=k, com=(0.3, 0, 0), inertia=TENSOR))
        for n, k in (("a", 1.0), ("b", mass), ("c", 2.0))
    )
    m.connect(m.world, Revolute("j1", axis="z", actuated=True), a)
    m.connect(a.at(0.4), Revolute("j2", axis="z"), b)
    m.connect(b.at(length), Revolute("j3", axis="z"), c.at(0.9))
    m.connect(m.world.at(0.8), Revolute("j4", axis="z"), c)
    m.add(WrenchSensor("pin", "j3"))
    return m.assemble(guess={"j1": 0.4, "j2": 0.7, "j4": 1.3})


def values_at(system, q, v, a, **parameters):
    """Efforts, tool pose and energies at a motion."""
    p = [system.parameter_values(parameters)] if system.parameters else []
    models = mbs.models.inverse_dynamics(system)(q, v, a, *p)
    pose = mbs.models.direct_geometry(system)(q, *p)
    energies = mbs.models.energy(system)(q, v, *p)
    return np.concatenate([np.array(x).ravel() for x in (models, pose, *energies)])


def test_models_equal_those_of_other_numbers() -> None:
    rng = np.random.default_rng(3)
    other = {"d2": 0.5, "r2": -0.2, "M2": 3.0, "XX2": 0.4, "Fv2": 0.7, "G3": -1.62}
    wished = ("masses", "inertias", "lengths", "friction", "gravity")
    system, built = symbolic(arm(), wished), arm(0.5, -0.2, 3.0, 0.4, 0.7, -1.62)
    for _ in range(5):
        motion = rng.uniform(-1, 1, (3, 3))
        assert np.abs(values_at(system, *motion) - values_at(arm(), *motion)).max() < 1e-12
        changed = values_at(system, *motion, **other)
        assert np.abs(changed - values_at(built, *motion)).max() < 1e-12
        assert np.abs(changed - values_at(arm(), *motion)).max() > 0.1


def test_names_defaults_units_and_zeros() -> None:
    system = symbolic(arm(), ["masses", "lengths", "rotors", "XY2", "M1", "Fv1"])
    told = {p.name: (p.default, p.unit) for p in system.parameters}
    assert told == {
        "M1": (0.0, "kg"),
        "r1": (0.3, "m"),
        "Fv1": (0.0, "N.m.s/rad"),
        "Ia1": (0.05, "kg.m2"),
        "XY2": (0.0, "kg.m2"),
        "M2": (2.0, "kg"),
        "d2": (0.4, "m"),
        "r2": (0.1, "m"),
        "M3": (1.0, "kg"),
        "d3": (0.2, "m"),
        "Ia3": (0.3, "kg"),
    }
    assert all(parameter.description for parameter in system.parameters)
    assert arm().parameters == ()


def test_a_body_stands_for_ten_parameters() -> None:
    names = [p.name for p in symbolic(four_bar(), "b").parameters]
    ten = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
    assert names == [f"{kind}2" for kind in ten]


def test_a_coupler_that_grows_closes_its_loop_and_pulls_in_its_pin() -> None:
    system, built = symbolic(four_bar(), ["lengths", "M2"]), four_bar(1.1, 2.5)
    assert "j3.frame_a.x" in [p.name for p in system.parameters]
    assert system.configuration == four_bar().configuration
    other = {"j3.frame_a.x": 1.1, "M2": 2.5}
    p = system.parameter_values(other)
    q = mbs.loops.solve(built, {"j1": 0.5})
    assert np.abs(np.array(mbs.loops.closure_residual(system)(q, p))).max() < 1e-12
    a = [
        np.array(f(q, [1.2], [-3.0], *more))
        for f, more in (
            (mbs.models.direct_dynamics(system), [p]),
            (mbs.models.direct_dynamics(built), []),
        )
    ]
    # M2 alone leaves the first moments, MX2 = 1.5 * 0.3, and the inertia where they are
    built_alone = symbolic(four_bar(1.1, 1.5), ["M2"])
    alone = np.array(mbs.models.direct_dynamics(built_alone)(q, [1.2], [-3.0], [2.5]))
    assert np.abs(a[0] - alone).max() < 1e-12
    assert np.abs(a[0] - a[1]).max() > 1e-3
    pins = [
        np.array(mbs.models.measurements(s)(q, [1.2], [-3.0], *more)[0])
        for s, more in ((system, [p]), (built_alone, [[2.5]]))
    ]
    assert np.abs(pins[0] - pins[1]).max() < 1e-11


def test_welded_bodies_share_one_mass() -> None:
    def welded(names):
        m = mbs.Mechanism("welded")
        a, b = (m.add(Body(n, mass=1.0, com=(0.1, 0, 0), inertia=TENSOR)) for n in "ab")
        m.connect(m.world, Revolute("j1", axis="z"), a)
        m.connect(a.at(0.5), Fixed("hold"), b)
        m.add(AbsoluteSensor("tip", b))
        return symbolic(m.assemble(), names)

    assert [p.name for p in welded(["M1"]).parameters] == ["M1"]
    with pytest.raises(ModelError, match=r"welded: b is one link with a, .*such as M1"):
        welded(["b"])


def test_a_link_all_of_whose_bodies_are_held_has_no_symbol() -> None:
    m = mbs.Mechanism("held")
    a, b, c = (m.add(Body(n, mass=1.0, com=(0.1, 0, 0), inertia=TENSOR)) for n in "abc")
    m.connect(m.world, Revolute("j1", axis="z"), a)
    m.connect(a.at(0.5), Fixed("one"), b)
    m.connect(c, Fixed("two"), b.at(0.5))
    with pytest.raises(
        ModelError, match=r"held: the mass of link 1 .* carried by one or two; give"
    ):
        symbolic(m.assemble(), ["masses"])


@pytest.mark.parametrize(
    ("what", "message"),
    [
        (["M9"], r"nothing called 'M9' that may become a symbol"),
        (["lenghts"], r"did you mean 'lengths'"),
        (["M2", "M2"], r"'M2' is to be a symbol twice; name it once"),
        (7, r"what is to be symbols is 7; give names"),
        ([None], r"nothing called None"),
    ],
)
def test_bad_names_are_refused(what, message) -> None:
    with pytest.raises(ModelError, match=rf"^arm: {message}|^arm: .*{message}"):
        symbolic(arm(), what)


def test_what_is_a_symbol_already_stays() -> None:
    once = symbolic(arm(), ["M2"])
    assert [p.name for p in symbolic(once, ["masses"]).parameters] == ["M2", "M3"]
    assert [p.name for p in symbolic(once, ["M2"]).parameters] == ["M2"]


def test_an_expression_of_a_symbol_is_no_number() -> None:
    m = mbs.Mechanism("rod")
    length = mbs.Parameter("L", 0.5)
    body = m.add(Body("a", mass=1.0, com=(0.1, 0, 0), inertia=TENSOR))
    tip = m.add(Body("b", mass=1.0, com=(0.1, 0, 0), inertia=TENSOR))
    m.connect(m.world, Revolute("j1", axis="z"), body)
    m.connect(body.at(2 * length), Revolute("j2", axis="z"), tip)
    with pytest.raises(ModelError, match=r"rod: d2 is an expression of L already"):
        symbolic(m.assemble(), ["d2"])
    assert [p.name for p in symbolic(m.assemble(), ["lengths"]).parameters] == ["L"]
