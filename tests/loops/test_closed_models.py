"""Models of closed systems against the constrained equations of motion, solved numerically."""

import numpy as np
import pytest
from support.closed_mechanisms import CLOSING, closed_chain, planar_loop

import mbs.models
from mbs.loops import closure_jacobian, closure_residual, reduction_matrix, solve

CASES = [
    *(pytest.param((closed_chain, seed, kind), id=kind) for seed, kind in enumerate(CLOSING)),
    *(pytest.param((planar_loop, seed, 3 + seed % 3), id=f"planar{seed}") for seed in range(4)),
]


@pytest.fixture(params=CASES)
def closed(request):
    make, *arguments = request.param
    mechanism, guess = make(*arguments)
    return mechanism.assemble(guess=guess)


def reference(system, q, v, tau):
    """Accelerations from [A J'; J 0] with every row kept, by least squares."""
    A = np.array(mbs.models.inertia_matrix(system, "tree")(q))
    H = np.array(mbs.models.bias(system, "tree")(q, v)).ravel()
    J = np.array(closure_jacobian(system)(q))
    h = 1e-6
    rate = np.array(system.qdot(q, v)).ravel()
    J_rate = (
        np.array(closure_jacobian(system)(q + h * rate))
        - np.array(closure_jacobian(system)(q - h * rate))
    ) / (2 * h)
    K = np.block([[A, -J.T], [J, np.zeros((len(J), len(J)))]])
    right = np.concatenate([tau - H, -J_rate @ v])
    return np.linalg.lstsq(K, right, rcond=1e-11)[0][: len(v)]


def test_configuration_closes(closed):
    phi = np.array(closure_residual(closed)(list(closed.configuration)))
    assert np.abs(phi).max() < 1e-12


def test_mobility_is_coordinates_minus_rank(closed):
    J = np.array(closure_jacobian(closed)(list(closed.configuration)))
    values = np.linalg.svd(J, compute_uv=False)
    assert closed.closure.mobility == closed.nv - np.sum(values > 1e-7)
    assert len(closed.closure.rows) == np.sum(values > 1e-7)


def test_direct_dynamics(closed):
    rng = np.random.default_rng(0)
    q = np.array(closed.configuration)
    ddm = mbs.models.direct_dynamics(closed)
    in_tree = mbs.models.direct_dynamics(closed, coordinates="tree")
    active = list(closed.independent)
    G = np.array(reduction_matrix(closed)(q))
    for _ in range(3):
        v_a = rng.uniform(-1, 1, len(active))
        tau_a = rng.uniform(-5, 5, len(active))
        tau = np.zeros(closed.nv)
        tau[active] = tau_a
        expected = reference(closed, q, G @ v_a, tau)
        scale = max(1.0, np.abs(expected).max())
        a, _ = in_tree(q, G @ v_a, tau)
        np.testing.assert_allclose(np.array(a).ravel(), expected, rtol=0, atol=2e-7 * scale)
        a_a = np.array(ddm(q, v_a, tau_a)).ravel()
        np.testing.assert_allclose(a_a, np.array(a).ravel()[active], rtol=0, atol=1e-9 * scale)
        back = np.array(mbs.models.inverse_dynamics(closed)(q, v_a, a_a)).ravel()
        np.testing.assert_allclose(back, tau_a, rtol=0, atol=1e-9 * max(1, np.abs(tau_a).max()))


def test_closed_matrices_agree(closed):
    rng = np.random.default_rng(1)
    q = np.array(closed.configuration)
    v_a = rng.uniform(-1, 1, len(closed.independent))
    a_a = rng.uniform(-1, 1, len(closed.independent))
    A = np.array(mbs.models.inertia_matrix(closed)(q))
    H = np.array(mbs.models.bias(closed)(q, v_a)).ravel()
    tau = np.array(mbs.models.inverse_dynamics(closed)(q, v_a, a_a)).ravel()
    np.testing.assert_allclose(A @ a_a + H, tau, rtol=0, atol=1e-9 * max(1, np.abs(tau).max()))
    assert np.linalg.eigvalsh((A + A.T) / 2).min() > 0
    E = float(mbs.models.energy(closed)(q, v_a)[0])
    assert v_a @ A @ v_a / 2 == pytest.approx(E, rel=1e-10)


def test_solve_keeps_what_is_given(closed):
    names = [closed.velocity_coordinates[k].name for k in closed.independent]
    values = {
        name: closed.configuration[closed.independent[i]] + 0.01 for i, name in enumerate(names)
    }
    q = solve(closed, values)
    for name, value in values.items():
        k = [c.name for c in closed.coordinates].index(name)
        assert q[k] == value
    assert np.abs(np.array(closure_residual(closed)(q))).max() < 1e-12


def test_report_counts_rows(closed):
    row = closed.loops[0]
    kept = len(row.rows) - len(row.dropped)
    assert f"{kept} of {len(row.rows)} rows are independent" in closed.report()
    assert f"Mobility {closed.closure.mobility}" in closed.report()


@pytest.mark.parametrize("closing", CLOSING)
def test_number_of_rows(closing):
    mechanism, guess = closed_chain(7, closing)
    system = mechanism.assemble(guess=guess)
    assert len(system.loops[0].rows) == CLOSING[closing][1]
    assert system.closure.mobility == 8 - CLOSING[closing][1]
