"""Newton and Euler for every body by itself, with numpy, from the description of a mechanism."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
import numpy as np

import mbs.models
from mbs.components import Joint, Spherical


@dataclass(frozen=True)
class State:
    """A motion of the tree: positions, velocities and accelerations."""

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray


def numbers(value):
    return np.array(casadi.DM(value))


def pose_of(system, name, q):
    """A body in the world, (4, 4)."""
    if name == "world":
        return np.eye(4)
    return np.array(mbs.models.transform(system, name)(q))


def motion_of(system, name, state):
    """w, wd, and acceleration of the origin of a body, all in its axes, and gravity there."""
    link, pose = system.frames[name]
    V = np.array(mbs.models.link_velocities(system, "tree")(state.q, state.v))[:, link]
    A = np.array(mbs.models.link_accelerations(system, "tree")(state.q, state.v, state.a))[:, link]
    R, p = numbers(pose.R), numbers(pose.p).ravel()
    w, wd = V[3:], A[3:]
    vd = A[:3] + np.cross(wd, p) + np.cross(w, np.cross(w, p))
    return R.T @ w, R.T @ wd, R.T @ vd


def inertial_wrench(mechanism, system, name, state):
    """Force and moment about the world's origin that move a body, less those of its weight."""
    own = mechanism.components[name].inertial({})
    J, ms, m = numbers(own.J), numbers(own.ms).ravel(), float(own.m)
    T = pose_of(system, name, state.q)
    w, wd, vd = motion_of(system, name, state)
    vd = vd - T[:3, :3].T @ numbers(system.tree.gravity).ravel()
    f = m * vd + np.cross(wd, ms) + np.cross(w, np.cross(w, ms))
    n = J @ wd + np.cross(w, J @ w) + np.cross(ms, vd)
    return about_origin(T, f, n)


def about_origin(T, f, m):
    """A wrench about and in a frame of pose T, about the world's origin in its axes."""
    force = T[:3, :3] @ f
    return np.concatenate([force, T[:3, :3] @ m + np.cross(T[:3, 3], force)])


def frames_of(mechanism, joint):
    """The points that the frames of a joint were connected to."""
    found = {}
    for first, second in mechanism.connections:
        for here, there in ((first, second), (second, first)):
            if isinstance(here.owner, Joint) and here.owner.name == joint:
                found[here.port] = there
    return found["a"], found["b"]


def out_of_balance(mechanism, system, state, F, forces=None):
    """For every moving body what is left of its equations, (6, bodies).

    Args:
        mechanism: description; every body is connected by joints alone.
        system: made of it.
        state: of the tree.
        F: (6, joints).
        forces: by body, wrenches of force elements on it about the world's origin.
    """
    rest = {row.name: -inertial_wrench(mechanism, system, row.name, state) for row in system.bodies}
    for name, wrench in (forces or {}).items():
        if name in rest:
            rest[name] = rest[name] + wrench
    for row, column in zip(system.joints, np.array(F).T, strict=True):
        a, b = frames_of(mechanism, row.name)
        T = pose_of(system, b.owner.name, state.q) @ numbers(b.placement.pose({}).matrix)
        wrench = about_origin(T, column[:3], column[3:])
        for point, sign in ((a, -1), (b, 1)):
            if point.owner.name in rest:
                rest[point.owner.name] = rest[point.owner.name] + sign * wrench
    return np.column_stack(list(rest.values()))


def tree_state(system, v_a, a_a):
    """The motion of the tree that independent velocities and accelerations make."""
    q = np.array(system.configuration)
    G = np.array(mbs.loops.reduction_matrix(system)(q))
    psi = np.array(mbs.models.acceleration_closure(system)(q, v_a)[0])
    count = mbs.loops.closure_residual(system).size1_out(0)
    rows = [*system.closure.rows, *(count + k for k in system.closure.slips)]
    J = np.array(mbs.loops.closure_jacobian(system)(q))[rows]
    passive = list(system.closure.passive)
    a = G @ a_a
    a[passive] -= np.linalg.solve(J[:, passive], psi).ravel()
    return State(q, G @ v_a, a)


def column(system, F, name):
    """The wrench of one joint."""
    return np.array(F)[:, [row.name for row in system.joints].index(name)]


def balanced(mechanism, system, state, F, tolerance=1e-9, forces=None):
    """Every body is in balance, to a tolerance relative to the largest wrench."""
    rest = out_of_balance(mechanism, system, state, F, forces)
    assert np.abs(rest).max() < tolerance * max(1.0, np.abs(np.array(F)).max())


def in_balance(mechanism, system, seed=7):
    """Bodies are in balance in both kinds of coordinates, whose wrenches are the same."""
    rng = np.random.default_rng(seed)
    v_a, a_a = rng.uniform(-1, 1, (2, len(system.independent)))
    state = tree_state(system, v_a, a_a)
    F = mbs.models.joint_wrenches(system)(state.q, v_a, a_a)
    balanced(mechanism, system, state, F)
    tau = np.zeros(system.nv)
    tau[list(system.independent)] = np.array(
        mbs.models.inverse_dynamics(system)(state.q, v_a, a_a)
    ).ravel()
    G = mbs.models.joint_wrenches(system, "tree")(state.q, state.v, state.a, tau)
    scale = max(1.0, np.abs(np.array(F)).max())
    np.testing.assert_allclose(np.array(G), np.array(F), rtol=0, atol=1e-9 * scale)
    return np.array(F)


def along(joint, name, q, system):
    """The unit twist (6) in frame_b of one velocity of a joint."""
    suffix = name.removeprefix(joint.name).removeprefix(".")
    if isinstance(joint, Spherical):
        return np.eye(6)[3 + ["wx", "wy", "wz"].index(suffix)]
    behind, found = [], None
    for freedom in joint.freedoms:
        if freedom.suffix == suffix:
            found = freedom
        elif found is not None:
            behind.append(freedom)
    axis, p = np.array(found.axis), np.zeros(3)
    names = [c.name for c in system.coordinates]
    for freedom in behind:
        x = q[names.index(f"{joint.name}.{freedom.suffix}")]
        if freedom.motion.value == "prismatic":
            p = p + x * np.array(freedom.axis)
        else:
            K = np.cross(np.eye(3), freedom.axis)
            R = (np.eye(3) - np.sin(x) * K + (1 - np.cos(x)) * K @ K).T
            axis, p = R.T @ axis, R.T @ p
    if found.motion.value == "prismatic":
        return np.concatenate([axis, np.zeros(3)])
    return np.concatenate([np.cross(axis, p), axis])
