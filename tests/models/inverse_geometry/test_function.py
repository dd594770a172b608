"""The Function of one branch: values, derivatives, symbols, text, machine code."""

import ctypes

import casadi
import numpy as np
import pytest
from casadi import DM, MX, SX, Function
from support.arm_search import distance, plain_arm, searched
from support.arms import general_6r
from support.catalogue_systems import catalogue_system

import mbs
from mbs.errors import ModelError, NoClosedForm
from mbs.export.languages import LANGUAGES
from mbs.models.inverse_geometry import InverseGeometry, function
from mbs.native import c_source, compile_library, compiled
from mbs.robots.rows import frame, robot

ROBOTS = ("puma560", "rx90", "stanford", "scara", "planar_2r")
H = np.pi / 2
POINTER = ctypes.POINTER(ctypes.c_double)


def assembled(name):
    return catalogue_system(name)


def symbolic_puma():
    """An arm like the PUMA whose lengths are symbols, with a hand."""
    rows = [
        frame(0, r="L"),
        frame(1, alpha=-H),
        frame(2, d="D3", r="R3"),
        frame(3, alpha=H, d="D4", r="R4"),
        frame(4, alpha=-H),
        frame(5, alpha=H),
    ]
    lengths = {"D3": 0.43, "R3": -0.1, "D4": 0.02, "R4": 0.4, "L": 0.1}
    return mbs.load({"name": "lengths", "parameters": lengths, "frame": rows}).assemble()


def state(system, seed):
    """A configuration (nq,) and the pose it gives."""
    rng = np.random.default_rng(seed)
    slides = [row.unit == "m" for row in system.coordinates]
    q = np.where(slides, rng.uniform(0.1, 0.6, system.nq), rng.uniform(-3, 3, system.nq))
    return q, np.array(mbs.models.direct_geometry(system)(q))


def found(igm, T, **more):
    """The valid configurations (m, nq), and their branches."""
    rows = [(b, *igm(T, b, *more.values())) for b in range(igm.branches)]
    valid = [(b, np.array(q).ravel()) for b, q, good in rows if float(good) == 1]
    return np.array([q for _, q in valid]), [b for b, _ in valid]


@pytest.mark.parametrize("name", ROBOTS)
def test_branches_are_all_the_solutions(name):
    system = assembled(name)
    igm, arm = function(system), plain_arm(system)
    _, T = state(system, 3)
    ours, _ = found(igm, T)
    theirs = searched(arm, T)
    assert len(ours) == len(theirs)
    assert max(np.min(distance(arm, ours, q)) for q in theirs) < 1e-7
    assert np.max(arm.residual(T, ours)) < 1e-13


def test_names_and_branches():
    igm = function(assembled("puma560"), "pieper")
    assert isinstance(igm, InverseGeometry)
    assert (igm.name(), igm.name_in(), igm.name_out()) == ("igm", ["T", "branch"], ["q", "valid"])
    assert igm.branches == 8 == len(set(igm.labels))
    assert sorted(place for one in igm.steps for place in one.indices) == list(range(6))
    assert function(igm.system, "pieper") is igm
    assert [name for name, _ in igm.elements("q")] == ["q1", "q2", "q3", "q4", "q5", "q6"]


def test_label_says_which_sign_each_branch_takes():
    """A change of one sign changes that joint, and none that was solved before it."""
    system = assembled("puma560")
    igm = function(system, "pieper")
    _, T = state(system, 4)
    q = [np.array(igm(T, b)[0]).ravel() for b in range(8)]
    order = [one.indices[0] for one in igm.steps]
    for b, label in enumerate(igm.signs):
        for other, theirs in enumerate(igm.signs):
            differ = [x for x, y in zip(label.split(), theirs.split(), strict=True) if x != y]
            if len(differ) == 1:
                place = int(differ[0][1]) - 1
                before = order[: order.index(place)]
                assert np.allclose(q[b][before], q[other][before], atol=1e-12)
                assert abs(q[b][place] - q[other][place]) > 1e-3


@pytest.mark.parametrize("name", ["puma560", "stanford"])
def test_derivative_is_the_inverse_of_the_jacobian(name):
    system = assembled(name)
    igm = function(system)
    q, T = state(system, 5)
    pose = mbs.models.direct_geometry(system)
    x, branch = SX.sym("q", 6), SX.sym("b")
    there_and_back = Function("f", [x, branch], [igm(pose(x), branch)[0]])
    slope = Function("J", [x, branch], [casadi.jacobian(there_and_back(x, branch), x)])
    configurations, branches = found(igm, T)
    for configuration, b in zip(configurations, branches, strict=True):
        assert np.allclose(np.array(slope(configuration, b)), np.eye(6), atol=1e-8)
    assert np.min(np.max(np.abs(configurations - q), axis=1)) < 1e-9


def test_out_of_reach_is_finite_and_not_valid():
    igm = function(assembled("puma560"))
    T = np.eye(4)
    T[:3, 3] = [3.0, 0.2, 0.1]
    for b in range(igm.branches):
        q, valid = igm(T, b)
        assert DM(q).is_regular()
        assert float(valid) == 0
    slope = Function("J", igm.sx_in(), [casadi.jacobian(igm(*igm.sx_in())[0], igm.sx_in()[0])])
    assert DM(slope(T, 0)).is_regular()


def test_pose_off_the_manifold_is_not_valid():
    system = assembled("scara")
    igm = function(system)
    _, T = state(system, 6)
    assert len(found(igm, T)[0]) == 2
    tilted = T @ np.array(mbs.models.direct_geometry(assembled("puma560"))([0, 0, 1e-6, 0, 0, 0]))
    assert len(found(igm, tilted)[0]) == 0


def test_parameters_stay_symbols():
    system = symbolic_puma()
    igm = function(system)
    assert igm.name_in() == ["T", "branch", "p"]
    for lengths in ({}, {"D3": 0.6, "R3": 0.15, "D4": -0.05, "R4": 0.3, "L": 0.25}):
        p = system.parameter_values(lengths)
        q, _ = state(system, 7)
        T = np.array(mbs.models.direct_geometry(system)(q, p))
        configurations, _ = found(igm, T, p=p)
        assert len(configurations) == 8
        assert np.min(np.max(np.abs(configurations - q), axis=1)) < 1e-9
        for configuration in configurations:
            assert np.allclose(np.array(mbs.models.direct_geometry(system)(configuration, p)), T)
    defaults = np.array(igm(T, 0, system.parameter_values())[0])
    assert np.array_equal(np.array(igm(T, 0)[0]), defaults)


def test_symbols_maps_and_machine_code():
    system = assembled("rx90")
    igm = function(system)
    poses = [state(system, seed)[1] for seed in range(4)]
    want = [np.array(igm(T, b)[0]).ravel() for b, T in enumerate(poses)]
    T, b = MX.sym("T", 4, 4), MX.sym("b")
    outer = Function("outer", [T, b], igm(T, b))
    side_by_side = igm.map(4)(np.hstack(poses), np.arange(4.0)[None])[0]
    fast = compiled(igm, derivatives=0, fast=True)
    for k, pose in enumerate(poses):
        assert np.array_equal(np.array(outer(pose, k)[0]).ravel(), want[k])
        assert np.array_equal(np.array(side_by_side[:, k]).ravel(), want[k])
        q, valid = fast(pose, np.array([float(k)]))
        assert np.allclose(q, want[k], atol=1e-12)
        assert valid == 1


def test_joints_outside_the_chain_stay_assembled():
    system = assembled("puma560")
    igm = function(system, frame=3, locked={"q2": 0.3})
    q, valid = igm(np.array(mbs.models.transform(system, 3)([0.2, 0.3, -0.4, 0, 0, 0])), 0)
    assert np.allclose(np.array(q).ravel(), [0.2, 0.3, -0.4, 0, 0, 0], atol=1e-12)
    assert float(valid) == 1


@pytest.mark.parametrize("language", LANGUAGES)
def test_text_in_every_language_names_the_coefficients(language):
    text = mbs.export.code(function(symbolic_puma(), "pieper"), language)
    named = text.replace("_", "").replace("{", "").replace("}", "").replace("\\", "")
    for name in ("D3", "R4", "U4", "V4", "X1", "signq3"):
        assert name.lower() in named.lower()


def test_python_text_runs_for_all_branches_at_once():
    system = symbolic_puma()
    igm, space = function(system), {}
    _, T = state(system, 8)
    p = np.array(system.parameter_values())
    exec(mbs.export.code(igm, "python"), space)
    branches = np.arange(float(igm.branches))
    q, valid = space["igm"](T[:, :, None], branches, p[:, None])
    for b in range(igm.branches):
        want, good = igm(T, b, p)
        assert np.allclose(q[:, b], np.array(want).ravel(), atol=1e-12)
        assert valid[b] == float(good) == 1


def test_c_text_runs(tmp_path):
    igm = function(symbolic_puma())
    source = tmp_path / "igm.c"
    source.write_text(mbs.export.code(igm, "c"))
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O1", "-fPIC", "-shared"]
    library = ctypes.CDLL(str(compile_library([source], (), strict, tmp_path / "igm.so")))
    _, T = state(igm.system, 9)
    p = np.array(igm.system.parameter_values())
    q, valid = np.full(6, np.nan), np.full(1, np.nan)
    for b in range(igm.branches):
        given = np.asfortranarray(T), np.array([float(b)]), p, q, valid
        library.igm(*(array.ctypes.data_as(POINTER) for array in given))
        assert np.allclose(q, np.array(igm(T, b)[0]).ravel(), atol=1e-12)
        assert valid[0] == 1


def test_general_method_gives_the_characteristic_matrix():
    system = general_6r(0)
    matrices = function(system, "general")
    assert matrices.name() == "igm_characteristic"
    assert matrices.name_out() == ["M0", "M1", "M2"]
    assert not matrices.prismatic
    q, T = state(system, 10)
    place = [row.name for row in system.coordinates].index(matrices.joint)
    M0, M1, M2 = (np.array(M) for M in matrices(T))

    def condition(x):
        values = np.linalg.svd(M0 + M1 * np.cos(x) + M2 * np.sin(x), compute_uv=False)
        return values[-1] / values[0]

    assert condition(q[place]) < 1e-13
    assert condition(q[place] + 0.1) > 1e-9
    assert "output M2 (12, 12)" in mbs.export.code(matrices, "symoro")


def test_wrong_questions():
    system = assembled("puma560")
    with pytest.raises(ModelError, match=r"method is 'peiper', .*did you mean 'pieper'"):
        function(system, "peiper")
    with pytest.raises(ModelError, match="branch 8 does not exist; the branches are 0 to 7"):
        function(system)(np.eye(4), 8)
    with pytest.raises(ModelError, match=r"branch 0\.5 does not exist"):
        function(system)(np.eye(4), 0.5)
    with pytest.raises(ModelError, match=r"its loops must be closed too.*inverse_geometry\.solve"):
        function(assembled("sr400"))
    rows = [frame(j, alpha=H * (-1) ** j, r=0.3) for j in range(7)]
    seven = robot("seven", "none", rows, []).assemble()
    with pytest.raises(ModelError, match=r"7 joints are free.*lock 1 of them"):
        function(seven)


def test_general_arm_has_no_closed_form():
    with pytest.raises(NoClosedForm, match=r"pieper: .*paul: .*use mbs\.models\.inverse_geometry"):
        function(general_6r(0))


@pytest.mark.parametrize("name", ["puma560", "ur5", "scara"])
def test_all_branches_in_one_function(name):
    """Column b is branch b; compiled and as C it gives the same."""
    system = assembled(name)
    one, every = function(system), function(system, branches="all")
    assert every.name() == "igm_all"
    assert every.labels == one.labels
    assert every.size_out(0) == (system.nq, one.branches)
    q = np.array([0.3, -0.5, 0.7, 0.4, 0.9, 0.2])[: system.nq]
    T = np.array(mbs.models.direct_geometry(system)(q))
    found, valid = (np.array(part) for part in every(T))
    machine = compiled(every)
    for b in range(one.branches):
        own, own_valid = (np.array(part).ravel() for part in one(T, b))
        assert bool(own_valid) == bool(valid[b])
        if own_valid:
            assert found[:, b] == pytest.approx(own, abs=1e-12)
    assert np.min(np.max(np.abs(found - q[:, None]), axis=0)) < 1e-12
    assert np.array_equal(machine(T)[0], found)
    far = T.copy()
    far[:3, 3] += 9.0
    assert not np.any(np.array(every(far)[1]))
    assert np.all(np.isfinite(np.array(every(far)[0])))
    assert "igm_all" in c_source(every)


def test_branches_that_are_not_known_are_refused():
    system = assembled("puma560")
    with pytest.raises(ModelError, match="branches is 'both'; use 'one' or 'all'"):
        function(system, branches="both")
    with pytest.raises(ModelError):
        function(system, branches="all")(np.diag([1, 1, 2.0, 1]))
