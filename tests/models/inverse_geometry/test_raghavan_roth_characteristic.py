import numpy as np
import pytest
from casadi import DM, SX, Function
from support.arms import general_6r, slides_and_turns
from support.catalogue_systems import catalogue_system

import mbs
from mbs.closed_forms.raghavan_roth import characteristic
from mbs.errors import NoClosedForm
from mbs.models.inverse_geometry.chain import frame_chain

CHARACTERISTIC = {
    "puma560": lambda: catalogue_system("puma560"),
    "ur5": lambda: catalogue_system("ur5"),
    "stanford": lambda: catalogue_system("stanford"),
    "gantry": lambda: catalogue_system("gantry"),
    "general": lambda: general_6r(0),
    "one slide": lambda: slides_and_turns("RRPRRR", 0),
    "slides apart": lambda: slides_and_turns("PRRPRR", 0),
}


def arm_of(system):
    return frame_chain(system).arm(np.array(system.p_default))


def configurations(arm, rng, count):
    turns = rng.uniform(-np.pi, np.pi, (count, arm.size))
    return np.where(arm.prismatic, 0.6 * arm.length * rng.uniform(-1, 1, turns.shape), turns)


def conditions(arm, found, given, shift, p=()):
    """Reciprocal conditions of the matrix at configurations, the joint moved by a shift."""
    q = SX.sym("q")
    function = Function("M", [q, given], [found.matrix(q)])
    result = []
    for configuration in configurations(arm, np.random.default_rng(11), 12):
        T = arm.pose(configuration)[:3].ravel(order="F")
        M = np.array(DM(function(configuration[found.index] + shift, np.concatenate([p, T]))))
        s = np.linalg.svd(M, compute_uv=False)
        result.append(s[-1] / s[0])
    return np.array(result)


@pytest.mark.parametrize("name", CHARACTERISTIC)
def test_characteristic_matrix_is_singular_at_configurations(name):
    system = CHARACTERISTIC[name]()
    own = frame_chain(system)
    problem, arm = own.problem(np.zeros(0)), arm_of(system)
    found = characteristic(problem)
    assert own.names[found.index] == found.joint
    assert found.prismatic == own.prismatic[found.index]
    assert np.max(conditions(arm, found, problem.given, 0.0)) < 1e-12
    shift = 0.4 * (arm.length if found.prismatic else 1)
    assert np.median(conditions(arm, found, problem.given, shift)) > 1e-6


def test_characteristic_matrix_of_symbolic_lengths():
    lengths = {"A": 0.025, "B": 0.455, "C": 0.42, "D": 0.1, "E": 0.08}
    rows = [(0, 0, 0), (1.5, "A", 0), (0, "B", 0), (1.5, 0.035, "C"), (-1.5, "D", 0), (1.5, 0, "E")]
    frames = [
        {"antecedent": k, "joint": "revolute", "alpha": alpha, "d": d, "r": r}
        for k, (alpha, d, r) in enumerate(rows)
    ]
    description = {"name": "arm", "parameters": lengths, "frame": frames}
    own = frame_chain(mbs.load(description).assemble())
    problem, p = own.problem(), np.array(list(lengths.values()))
    found, other = characteristic(problem), 1.3 * p
    assert np.max(conditions(own.arm(p), found, problem.given, 0.0, p)) < 1e-12
    assert np.max(conditions(own.arm(other), found, problem.given, 0.0, other)) < 1e-12
    assert np.median(conditions(own.arm(p), found, problem.given, 0.4, p)) > 1e-6


def test_characteristic_matrix_needs_six_joints():
    problem = frame_chain(catalogue_system("scara")).problem(np.zeros(0))
    with pytest.raises(NoClosedForm, match="4 joints"):
        characteristic(problem)
