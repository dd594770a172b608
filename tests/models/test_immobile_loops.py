"""A triangle of bars that cannot move: every model equals that of one rigid body in its place."""

from math import acos

import casadi
import numpy as np
import pytest
from support.builders import BUILDERS, system_of
from support.immobile_loops import A, B, C, triangle

import mbs
import mbs.models
from mbs import identification
from mbs.components import Revolute
from mbs.models import dae
from mbs.native import batch, compiled

MOVES = {"still_triangle": False, "turning_triangle": True}
both = pytest.mark.parametrize("name", MOVES)


def numbers(value):
    return np.array(casadi.DM(value))


class Pair:
    """The two mechanisms and a state that they share.

    Attributes:
        bars, rigid: with joined bars, and with welded ones.
        q, rigid_q: positions.
        v, a, tau: of the independent joints.
        G: velocities of the tree from those of the independent joints.
    """

    def __init__(self, name):
        self.bars = system_of(name)
        self.rigid = triangle(moves=MOVES[name], rigid=True)
        rng = np.random.default_rng(5)
        self.rigid_q, self.v, self.a, self.tau = rng.uniform(-1, 1, (4, self.rigid.nq))
        names = [c.name for c in self.bars.coordinates]
        there = dict(zip((c.name for c in self.rigid.coordinates), self.rigid_q, strict=True))
        self.q = np.array(
            [there.get(n, x) for n, x in zip(names, self.bars.configuration, strict=True)]
        )
        self.G = numbers(mbs.loops.reduction_matrix(self.bars)(self.q))
        self.rows = [names.index(name) for name in there]

    def tree(self, values):
        """What a vector of the independent joints is in the tree."""
        full = np.zeros(self.bars.nv)
        full[self.rows] = values
        return full

    def arguments(self, f, *, rigid):
        """What a Function takes at the state, by the names of its inputs."""
        rng = np.random.default_rng(7)
        at = {"v": self.v, "a": self.a, "tau": self.tau}
        at |= {f"{key}_a": value for key, value in at.items()}
        if not rigid and f.size1_in("v" if "v" in f.name_in() else 0) == self.bars.nv:
            at |= {key: self.tree(at[key]) for key in ("v", "a", "tau")}
        at |= {"q": self.rigid_q if rigid else self.q, "a_p": self.a[:1], "p": []}
        at |= {n: rng.uniform(-1, 1, (6, 1)) for n in ("v_0", "a_0")} | {"R_0": np.eye(3)}
        return [at[n] for n in f.name_in()]

    def results(self, build, *, short=True):
        """Outputs by name, without the `_a` of independent joints, of the model of either."""
        found = []
        for system, rigid in ((self.bars, False), (self.rigid, True)):
            f = build(system)
            values = outputs_at(f, self.arguments(f, rigid=rigid))
            names = [n.replace("_a", "") if short else n for n in f.name_out()]
            found.append(dict(zip(names, values, strict=True)))
        return found


def outputs_at(f, arguments):
    return [numbers(x) for x in casadi.Function.call(f, [casadi.DM(a) for a in arguments])]


PAIRS = {}


def pair_of(name):
    if name not in PAIRS:
        PAIRS[name] = Pair(name)
    return PAIRS[name]


def close(a, b, tolerance=1e-12):
    np.testing.assert_allclose(a, b, rtol=0, atol=tolerance * max(1, np.abs(b).max(initial=0)))


ALIKE = {
    **{n: BUILDERS[n] for n in ("bias", "direct_dynamics", "direct_dynamics_derivatives")},
    **{n: BUILDERS[n] for n in ("gravity_effort", "inertia_matrix", "inverse_dynamics")},
    **{n: BUILDERS[n] for n in ("inverse_dynamics_derivatives", "known_efforts")},
    **{
        f"lagrange, {method}": lambda s, m=method: mbs.models.lagrange(s, m)
        for method in ("auto", "renaud", "christoffel")
    },
    "energy": mbs.models.energy,
    "transform": lambda s: mbs.models.transform(s, "arm"),
    "jacobian": lambda s: mbs.models.jacobian(s, "arm"),
    "jacobian_dot_velocity": lambda s: mbs.models.jacobian_dot_velocity(s, "arm"),
    "moving base": lambda s: mbs.models.inverse_dynamics(s, moving_base=True),
}
"""Models whose outputs are the same numbers."""


@pytest.mark.sweep
@both
@pytest.mark.parametrize("builder", ALIKE)
def test_models_of_the_independent_joints(name, builder):
    found, expected = pair_of(name).results(ALIKE[builder])
    assert found.keys() == expected.keys()
    if builder == "energy" and name == "still_triangle":  # the ground has no potential energy
        ground = mbs.models.energy(pair_of(name).bars)(pair_of(name).q * [1, 1, 0], 0)[1]
        arm = mbs.models.energy(pair_of(name).rigid)(0, 0)[1]
        expected["U"] += numbers(ground - arm)
    for key, value in expected.items():
        close(found[key], value)


@both
def test_motion_of_the_links(name):
    pair = pair_of(name)
    for build in (mbs.models.link_velocities, mbs.models.link_accelerations):
        found, expected = (next(iter(r.values())) for r in pair.results(build))
        close(found[:, -1], expected[:, -1])  # the arm is the last link of both


@both
def test_tree_coordinates(name):
    """The bars keep still, the other joints move as they do without them."""
    pair = pair_of(name)
    expected = numbers(mbs.models.direct_dynamics(pair.rigid)(pair.rigid_q, pair.v, pair.tau))
    model = mbs.models.direct_dynamics(pair.bars, coordinates="tree")
    a, lam = map(numbers, model(pair.q, pair.tree(pair.v), pair.tree(pair.tau)))
    close(a[:, 0], pair.tree(expected[:, 0]), 1e-11)
    efforts = numbers(mbs.models.inverse_dynamics(pair.bars, "tree")(pair.q, pair.tree(pair.v), a))
    J = numbers(mbs.loops.closure_jacobian(pair.bars)(pair.q))[list(pair.bars.closure.rows)]
    close(efforts, pair.tree(pair.tau)[:, None] + J.T @ lam, 1e-11)


@both
def test_lagrange_in_tree_coordinates(name):
    pair = pair_of(name)
    for method in ("renaud", "christoffel"):
        f = mbs.models.lagrange(pair.bars, method, coordinates="tree")
        matrices = map(numbers, f(pair.q, pair.tree(pair.v)))
        g = mbs.models.lagrange(pair.rigid, method)
        for whole, part in zip(matrices, g(pair.rigid_q, pair.v), strict=True):
            small = pair.G.T @ whole
            close(small if whole.shape[1] == 1 else small @ pair.G, numbers(part))


@both
def test_closures_of_what_does_not_move(name):
    pair = pair_of(name)
    psi, phi, G_rate = map(numbers, mbs.models.acceleration_closure(pair.bars)(pair.q, pair.v))
    close(np.vstack([psi, phi]), np.zeros((len(psi) + len(phi), 1)))
    close(G_rate, 0 * pair.G)
    tree = mbs.models.acceleration_closure(pair.bars, coordinates="tree")
    for ours, theirs in zip(
        map(numbers, tree(pair.q, pair.tree(pair.v))), (psi, phi, G_rate), strict=True
    ):
        close(ours, theirs)
    close(pair.G, np.array([pair.tree(e) for e in np.eye(len(pair.v))]).T)


@both
def test_sensors(name):
    """One on the cut joint reads a constant angle, the others what they read without the bars."""
    pair = pair_of(name)
    assert [row.joint for row in pair.bars.cut_coordinates] == ["c3"]
    found, expected = pair.results(mbs.models.measurements, short=False)
    for key, value in expected.items():
        close(found[key], value, 1e-11)
    angle = acos((B**2 + C**2 - A**2) / (2 * B * C))
    assert [found[f"foot_{key}"].item() for key in "qva"] == pytest.approx([angle, 0, 0], abs=1e-12)


@both
@pytest.mark.parametrize("form", ["reduced", "index1", "index2", "index3", "ggl"])
def test_dae(name, form):
    """The accelerations and row efforts of the direct model fulfil each form."""
    pair = pair_of(name)
    d = dae(pair.bars, form)
    model = mbs.models.direct_dynamics(pair.bars, coordinates="tree")
    v, tau = pair.tree(pair.v), pair.tree(pair.tau)
    a, lam = (numbers(x).ravel() for x in model(pair.q, v, tau))
    values = {f"{c.name}.q": x for c, x in zip(pair.bars.coordinates, pair.q, strict=True)}
    values |= {f"{s.name}.v": x for s, x in zip(pair.bars.velocity_coordinates, v, strict=True)}
    rates = {f"{c.name}.q": x for c, x in zip(pair.bars.coordinates, v, strict=True)}
    rates |= {f"{s.name}.v": x for s, x in zip(pair.bars.velocity_coordinates, a, strict=True)}
    x = [values[key] for key, _ in d.elements["x"]]
    z = np.concatenate([a, lam, np.zeros(len(lam))])[: d.z.numel()] if form != "reduced" else []
    ode, alg, invariants, q_of, v_of = map(numbers, d.function()(x, z, pair.tau, d.p0))
    close(ode.ravel(), np.array([rates[key] for key, _ in d.elements["x"]]), 1e-11)
    close(alg, np.zeros(alg.shape), 1e-11)
    close(invariants, np.zeros(invariants.shape), 1e-11)
    close(np.vstack([q_of, v_of]).ravel(), np.concatenate([pair.q, v]), 1e-11)


@both
def test_regressors(name):
    """With the parameters of the bodies they give the efforts and the energy."""
    pair = pair_of(name)
    system = pair.bars
    f = identification.regressor(system)
    X = identification.numeric_parameters(system, f.columns)
    D = numbers(f(pair.q, pair.v, pair.a))
    expected = numbers(mbs.models.inverse_dynamics(pair.rigid)(pair.rigid_q, pair.v, pair.a))
    known = numbers(identification.known_efforts(system)(pair.q, pair.v))
    close(D @ X[:, None] + known, expected, 1e-11)


@both
def test_base_parameters_are_those_without_the_bars(name):
    pair = pair_of(name)
    counts = [
        identification.base_parameters(system, method="numeric").count
        for system in (pair.bars, pair.rigid)
    ]
    assert counts[0] == counts[1]
    assert identification.base_parameters(pair.bars).count == counts[0]


@both
def test_batches_and_machine_code(name):
    pair = pair_of(name)
    models = [mbs.models.direct_dynamics(pair.bars), mbs.models.lagrange(pair.bars)]
    at = [pair.arguments(f, rigid=False) for f in models]
    for f, given in zip(models, at, strict=True):
        expected = outputs_at(f, given)
        for ours, theirs in zip(outputs_at(compiled(f), given), expected, strict=True):
            close(ours, theirs)
        rows = [np.tile(np.ravel(x), (5, 1)) for x in given]
        results = batch(f)(*rows)
        results = results if isinstance(results, tuple) else (results,)
        for ours, theirs in zip(results, expected, strict=True):
            for one in np.asarray(ours):
                close(one.reshape(theirs.shape), theirs)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_a_structure_without_motion_has_an_fmu(fmi, kind, tmp_path):
    """Both bars of a triangle keep their angles; the effort on the ground is that of a run."""
    m = mbs.Mechanism("truss", gravity=(0, -9.81, 0))
    a, b = (m.add(mbs.components.Box(n, length=1, width=0.05, mass=1)) for n in "ab")
    m.connect(m.world, Revolute("j1"), a.left)
    m.connect(a.right, Revolute("j2"), b.left)
    m.connect(m.world.at(1.2), Revolute("j3"), b.right)
    system = m.assemble(guess={"j1": 0.9, "j2": -1.8})
    assert system.closure.mobility == 0
    path = mbs.export.fmu(system, tmp_path / "truss.fmu", fmi=fmi)
    imported = mbs.simulate.fmu(path, 0.1, kind=kind, quiet=True)
    result = mbs.simulate.run(system, 0.1)
    for name, angle in {"j1": acos(0.6), "j2": -2 * acos(0.6)}.items():
        close(imported[f"{name}.q"], np.full(len(imported.time), angle))
        close(result[f"{name}.q"], np.full(len(result.time), angle))
        close(imported[f"{name}.a"], np.zeros(len(imported.time)))


@both
def test_simulation_and_fmu(name, tmp_path):
    pair = pair_of(name)
    starts = {f"q{k}": 0.3 for k in ((1, 2) if MOVES[name] else (2,))}
    ends = []
    for system in (pair.bars, pair.rigid):
        result = mbs.simulate.run(system, 0.5, q0=starts, tolerance=1e-10)
        path = mbs.export.fmu(system, tmp_path / f"{system.name}.fmu", outputs=["energy"])
        imported = mbs.simulate.fmu(
            path, 0.5, start={f"{n}.q": x for n, x in starts.items()}, tolerance=1e-10
        )
        for n in starts:
            assert imported[f"{n}.q"][-1] == pytest.approx(result[f"{n}.q"][-1], abs=1e-6)
        ends.append([result[f"{n}.{k}"][-1] for n in starts for k in "qv"])
    close(np.array(ends[0]), np.array(ends[1]), 1e-7)
