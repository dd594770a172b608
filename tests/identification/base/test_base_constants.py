"""The numeric method on systems with symbols: what was found at one length is used at no other."""

import importlib
import pickle

import numpy as np
import pytest
from support.base_robots import row

import mbs
from mbs.components import Body, Prismatic, Revolute, Rod, Spring
from mbs.errors import ModelError
from mbs.identification import base_parameters, regressor

INERTIA = (0.02, 0, 0, 0.03, 0, 0.04)


def planar(**changes):
    """Two links of which lengths, gravity and inertial parameters are symbols."""
    frames = [row(0), row(1, d="L1")]
    bodies = [
        {"frame": 1, "grouped": True, "ZZ": 0.3, "MX": "L1*M1/2", "M": "M1", "Fv": "F"},
        {"frame": 2, "grouped": True, "ZZ": "Z2", "MX": 0.4, "MY": 0.1, "M": 2.0, "Ia": 0.1},
    ]
    values = {"L1": 0.5, "G": 9.81, "M1": 3.0, "Z2": 0.2, "F": 0.4, **changes}
    rows = {"name": "planar", "frame": frames, "body": bodies, "gravity": [0, "-G", 0]}
    for name in [name for name, value in values.items() if value is None]:
        del values[name]
    return mbs.load({**rows, "parameters": values}).assemble()


def at(system, values):
    """The input p of a system, from values by name."""
    return [values[parameter.name] for parameter in system.parameters]


def states(system, count=5):
    rng = np.random.default_rng(3)
    return rng.uniform(-2, 2, (count, 3, system.nv))


def test_lengths_and_gravity_are_constants_of_the_result():
    base = base_parameters(planar(), "numeric")
    assert [p.name for p in base.system.parameters] == ["M1", "F", "Z2"]
    assert base.apply().parameters == base.system.parameters
    assert base.function.size_in("p") == (3, 1)
    assert "it holds at the defaults of G, L1 alone" in base.check.text


def test_parameters_of_the_whole_system_are_refused_on_every_way_to_call():
    system = planar()
    base = base_parameters(system, "numeric")
    q, v, a = states(system)[0]
    longer = at(system, {"L1": 1.0, "G": 9.81, "M1": 3.0, "Z2": 0.2, "F": 0.4})
    assert mbs.models.inverse_dynamics(system)(q, v, a, longer).shape == (2, 1)
    model = mbs.models.inverse_dynamics(base.apply())
    for call in (model, mbs.native.compiled(model), pickle.loads(pickle.dumps(model))):
        with pytest.raises((ModelError, RuntimeError, NotImplementedError)):
            call(q, v, a, longer)
    with pytest.raises((ModelError, RuntimeError, NotImplementedError)):
        model.map(3)(*(np.tile(x, (3, 1)).T for x in (q, v, a, longer)))
    with pytest.raises((ModelError, RuntimeError, NotImplementedError)):
        base.function(np.ones(len(base.columns)), longer)


def test_it_follows_the_parameters_that_are_left_as_the_symbolic_method_does():
    system = planar()
    base = base_parameters(system, "numeric")
    numeric, symbolic = base.apply(), base_parameters(system).apply()
    full = mbs.models.inverse_dynamics(system)
    fewer, wanted = mbs.models.inverse_dynamics(numeric), mbs.models.inverse_dynamics(symbolic)
    rng = np.random.default_rng(7)
    for state in states(system):
        values = {
            "L1": 0.5,
            "G": 9.81,
            "M1": rng.uniform(1, 3),
            "Z2": rng.uniform(0.1, 3),
            "F": 0.9,
        }
        p, left = at(system, values), at(base.system, values)
        expected = np.array(full(*state, p))
        assert np.array(fewer(*state, left)) == pytest.approx(
            expected, abs=1e-12 * (1 + np.abs(expected).max())
        )
        assert np.array(wanted(*state, p)) == pytest.approx(
            expected, abs=1e-12 * (1 + np.abs(expected).max())
        )
        defaults = np.array(fewer(*state))
        assert defaults == pytest.approx(
            np.array(full(*state)), abs=1e-12 * (1 + np.abs(defaults).max())
        )


@pytest.mark.parametrize("length", [0.5, 1.0, -0.7])
def test_other_lengths_are_described_and_grouped_anew(length):
    system = planar(L1=length)
    fewer = mbs.models.inverse_dynamics(base_parameters(system, "numeric").apply())
    full = mbs.models.inverse_dynamics(system)
    for state in states(system):
        expected = np.array(full(*state))
        assert np.array(fewer(*state)) == pytest.approx(
            expected, abs=1e-12 * (1 + np.abs(expected).max())
        )


def test_base_parameters_and_their_regressor_give_the_efforts():
    """With the system of the result, which is the one that both hold for."""
    base = base_parameters(planar(), "numeric")
    D = regressor(base.system, columns=base.columns_in_base)
    idm = mbs.models.inverse_dynamics(base.system)
    full = regressor(base.system, columns=base.columns)
    K = np.random.default_rng(1).uniform(0.1, 1, len(base.columns))
    for q, v, a in states(base.system):
        expected = np.array(full(q, v, a) @ K)
        assert np.array(D(q, v, a) @ base.function(K)) == pytest.approx(expected, abs=1e-12)
    assert idm.size_in("p") == (3, 1)


def test_without_symbols_of_lengths_nothing_becomes_a_constant():
    frames, bodies = [row(0), row(1, d=0.5)], [{"frame": 1, "ZZ": "Z1"}, {"frame": 2, "ZZ": 0.2}]
    rows = {"name": "twins", "frame": frames, "body": bodies, "parameters": {"Z1": 0.3}}
    system = mbs.load(rows).assemble()
    base = base_parameters(system, "numeric")
    assert base.system is system
    assert "alone" not in base.check.text
    q, v, a = states(system)[0]
    full, fewer = (mbs.models.inverse_dynamics(one) for one in (system, base.apply()))
    for Z1 in (0.3, 1.0):
        assert np.array(fewer(q, v, a, Z1)) == pytest.approx(np.array(full(q, v, a, Z1)), abs=1e-12)


def test_a_length_without_default_is_refused_and_an_inertia_without_is_not():
    with pytest.raises(ModelError, match=r"planar: .*default of 'L1', which has none; give it"):
        base_parameters(planar(L1=None), "numeric")
    base = base_parameters(planar(Z2=None), "numeric")
    assert [p.name for p in base.system.parameters] == ["M1", "F", "Z2"]


def closed(rod, at=1.2):
    """A crank and a rocker with a massless rod between their ends, with a spring beside."""
    m = mbs.Mechanism("rods", gravity=(0, -9.81, 0))
    crank = m.add(Body("crank", mass=1.0, com=(0.2, 0.05, 0), inertia=INERTIA))
    rocker = m.add(Body("rocker", mass=2.0, com=(0.3, 0, 0), inertia=INERTIA))
    m.connect(m.world, Revolute("j1", axis="z", actuated=True), crank)
    m.connect(m.world.at(at, 0, 0), Revolute("j2", axis="z"), rocker)
    m.connect(crank.at(0.4, 0, 0), Rod("rod", length=rod), rocker.at(0.6, 0, 0))
    return m.assemble(guess={"j1": 1.0, "j2": 1.8})


@pytest.mark.parametrize("symbol", ["rod", "at"])
def test_lengths_that_only_the_loop_knows_are_constants_too(symbol):
    """The length of a rod, and a distance on the base, which velocities do not show."""
    numbers = {"rod": 1.0, "at": 1.2}
    system = closed(**{**numbers, symbol: mbs.Parameter("L", numbers[symbol])})
    twin = closed(**numbers)
    base = base_parameters(system, "numeric")
    assert base.system.parameters == ()
    expected = base_parameters(twin, "numeric")
    assert [c.name for c in base.kept] == [c.name for c in expected.kept]
    assert base.matrix == pytest.approx(expected.matrix, abs=1e-9)
    fewer = mbs.models.inverse_dynamics(base.apply())
    assert fewer.n_in() == 3
    q = np.array(twin.configuration)
    want = np.array(mbs.models.inverse_dynamics(twin)(q, [0.7], [-0.4]))
    assert np.array(fewer(q, [0.7], [-0.4])) == pytest.approx(want, abs=1e-9)


def test_everything_that_a_system_holds_knows_the_constants():
    """Frames, force elements and sensors of a system whose symbols became numbers."""
    m = mbs.Mechanism("held", gravity=(0, 0, -9.81))
    L = mbs.Parameter("L", 0.4)
    arm = m.add(Body("arm", mass=1.0, com=(L, 0, 0), inertia=INERTIA))
    M = mbs.Parameter("M", 0.5)
    tip = m.add(Body("tip", mass=M, com=(0.1, 0, 0), inertia=INERTIA))
    m.connect(m.world, Revolute("j1", axis="y"), arm)
    m.connect(arm.at(L, 0, 0), Prismatic("j2", axis="z"), tip)
    m.add(Spring("spring", m.world.at(0, 0, L), tip.frame, stiffness=100.0, length="2*L"))
    m.add_frame("tool", tip.at(0, L, 0))
    system = m.assemble()
    base = base_parameters(system, "numeric")
    assert [p.name for p in base.system.parameters] == ["M"]
    for state in states(system):
        p = {"L": 0.4, "M": 0.9}
        every = [p[parameter.name] for parameter in system.parameters]
        full = mbs.models.inverse_dynamics(system)(*state, every)
        fewer = mbs.models.inverse_dynamics(base.apply())(*state, 0.9)
        assert np.array(fewer) == pytest.approx(np.array(full), abs=1e-11)
        q = state[0]
        assert np.array(mbs.models.transform(base.system, "tool")(q)) == pytest.approx(
            np.array(mbs.models.transform(system, "tool")(q, every)), abs=1e-15
        )


def test_rules_that_are_not_exact_leave_no_parameter_that_they_ignore(monkeypatch):
    """The rank then decides, at the defaults: lengths are constants as in the numeric method."""
    module = importlib.import_module("mbs.identification._base_parameters")
    rules = module.grouped_by_rules

    def bent(system, *arguments):
        grouping = rules(system, *arguments)
        kept = set(grouping.kept)
        columns = (
            terms if k in kept else {i: 1.1 * x for i, x in terms.items()}
            for k, terms in enumerate(grouping.columns)
        )
        return type(grouping)(tuple(columns))

    monkeypatch.setattr(module, "grouped_by_rules", bent)
    base = base_parameters(planar())
    assert not base.check.agrees
    assert "the rank groups the parameters" in base.check.text
    assert [p.name for p in base.system.parameters] == ["M1", "F", "Z2"]


def test_the_menu_shows_the_set_of_a_robot_with_symbols():
    from mbs.app.tasks.base import base

    shown = base(planar(), "numeric")
    expected = base(planar(), "symbolic")
    assert {row.name: row.value for row in shown.rows} == pytest.approx(
        {row.name: row.value for row in expected.rows}
    )
