"""What holds for every mechanism that hypothesis can draw."""

import contextlib

import casadi
import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.closed_mechanisms import CLOSING, closed_chain, planar_loop
from support.random_trees import ALL_KINDS, random_state, random_tree
from support.sweeps import examples

import mbs.models
import mbs.simulate
from mbs import MbsError
from mbs.loops import closure_residual

COMMON = dict(deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))


@st.composite
def trees(draw):
    """A random tree: its seed, its number of joints, and whether its axes are aligned."""
    kinds = draw(st.lists(st.sampled_from(ALL_KINDS), min_size=1, max_size=4, unique=True))
    return random_tree(
        draw(st.integers(0, 10**6)),
        n=draw(st.integers(1, 5)),
        kinds=tuple(kinds),
        aligned=draw(st.booleans()),
        serial=draw(st.booleans()),
    ).mechanism


@st.composite
def closed(draw):
    """A random closed mechanism, planar or spatial, with the guess that closes it."""
    seed = draw(st.integers(0, 10**6))
    if draw(st.booleans()):
        return planar_loop(seed, draw(st.integers(3, 5)))
    return closed_chain(seed, draw(st.sampled_from(sorted(CLOSING))), draw(st.integers(7, 8)))


@settings(max_examples=examples(25), **COMMON)
@given(trees(), st.integers(0, 10**6))
def test_direct_and_inverse_dynamics_are_inverse(mechanism, seed):
    system = mechanism.assemble()
    q, v, a = random_state(system, np.random.default_rng(seed))
    tau = np.array(mbs.models.inverse_dynamics(system)(q, v, a)).ravel()
    A = np.array(mbs.models.inertia_matrix(system)(q))
    back = np.array(mbs.models.direct_dynamics(system)(q, v, tau)).ravel()
    error = np.abs(back - a).max()
    assert error < 1e-14 * np.linalg.cond(A) * max(1.0, np.abs(tau).max()) + 1e-10


@settings(max_examples=examples(25), **COMMON)
@given(trees(), st.integers(0, 10**6))
def test_power_is_the_rate_of_energy(mechanism, seed):
    system = mechanism.assemble()
    q, v, a = random_state(system, np.random.default_rng(seed))
    q_s, v_s = casadi.SX.sym("q", system.nq), casadi.SX.sym("v", system.nv)
    total = sum(mbs.models.energy(system)(q_s, v_s))
    direction = casadi.vertcat(system.qdot(q, v), a)
    rate = casadi.jtimes(total, casadi.vertcat(q_s, v_s), direction)
    dE = float(casadi.Function("f", [q_s, v_s], [rate])(q, v))
    friction = np.concatenate([[float(k.Fv)] * k.motion.nv for k in system.tree.links])
    tau = np.array(mbs.models.inverse_dynamics(system)(q, v, a)).ravel()
    power = v @ (tau - friction * v)
    assert abs(power - dE) < 1e-9 * max(1.0, np.abs(v * tau).sum())


@settings(max_examples=examples(20), **COMMON)
@given(trees(), st.integers(0, 10**6))
def test_lagrange_form_is_newton_euler(mechanism, seed):
    system = mechanism.assemble()
    q, v, a = random_state(system, np.random.default_rng(seed))
    A, B, Q = (np.array(x) for x in mbs.models.lagrange(system)(q, v))
    friction = np.concatenate([[float(k.Fv)] * k.motion.nv for k in system.tree.links])
    tau = np.array(mbs.models.inverse_dynamics(system)(q, v, a)).ravel()
    difference = A @ a + B @ v + Q.ravel() + friction * v - tau
    assert np.abs(difference).max() < 1e-10 * max(1.0, np.abs(tau).max())


@settings(max_examples=examples(20), **COMMON)
@given(closed())
def test_closed_mechanism_assembles_and_its_models_agree(drawn):
    mechanism, guess = drawn
    system = mechanism.assemble(guess=guess)
    q = np.array(system.configuration)
    assert np.abs(np.array(closure_residual(system)(q))).max() < 1e-12
    rng = np.random.default_rng(0)
    v_a, a_a = rng.uniform(-1, 1, (2, len(system.independent)))
    tau = mbs.models.inverse_dynamics(system)(q, v_a, a_a)
    A = np.array(mbs.models.inertia_matrix(system)(q))
    back = np.array(mbs.models.direct_dynamics(system)(q, v_a, tau)).ravel()
    scale = np.linalg.cond(A) * max(1.0, np.abs(np.array(tau)).max())
    assert np.abs(back - a_a).max() < 1e-13 * scale + 1e-9


@settings(max_examples=examples(12), **COMMON)
@given(closed())
def test_loops_stay_closed_along_a_motion(drawn):
    """Closure below 1e-12, and energy kept, over half a second from rest."""
    mechanism, guess = drawn
    system = mechanism.assemble(guess=guess)
    result = mbs.simulate.run(
        system, 0.5, q0=list(system.configuration), step=0.05, tolerance=1e-9, quiet=True
    )
    for row in result.values:
        residual = np.array(closure_residual(system)(row[: system.nq]))
        assert np.abs(residual).max() < 1e-12
    losses = dissipated(system, result)
    total = result["kinetic_energy"] + result["potential_energy"]
    scale = max(1.0, np.abs(result["kinetic_energy"]).max())
    assert abs(total[-1] - total[0] + losses) < 2e-4 * scale


def dissipated(system, result):
    """Energy that viscous friction takes, integrated along the recorded motion [J]."""
    fine = mbs.simulate.run(
        system, float(result.time[-1]), q0=list(system.configuration), step=1e-3, quiet=True
    )
    power = sum(
        float(link.Fv) * fine[f"{speed.name}.v"] ** 2
        for link, speed in zip(system.tree.links, system.velocity_coordinates, strict=True)
    )
    return float(np.trapezoid(power, fine.time))


@settings(max_examples=examples(30), **COMMON)
@given(st.text(max_size=20))
def test_no_text_is_ever_run(text):
    """Any text is a number, an expression of symbols, or an error of ours."""
    with contextlib.suppress(MbsError):
        mbs.components.Body("b", mass=text)
