"""Newton and Euler in world axes with numpy, row by row of a table, and nothing clever."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, sin

import numpy as np


@dataclass(frozen=True)
class MovingBase:
    """Motion of the base frame: velocities and accelerations in its axes, R in the fixed frame."""

    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    v: np.ndarray = field(default_factory=lambda: np.zeros(3))
    w: np.ndarray = field(default_factory=lambda: np.zeros(3))
    vd: np.ndarray = field(default_factory=lambda: np.zeros(3))
    wd: np.ndarray = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class Moved:
    """A frame in base axes: where it is, its axis, how fast it turns and is accelerated."""

    R: np.ndarray
    p: np.ndarray
    z: np.ndarray
    w: np.ndarray
    wd: np.ndarray
    vd: np.ndarray


def about_x(angle):
    return np.array([[1, 0, 0], [0, cos(angle), -sin(angle)], [0, sin(angle), cos(angle)]])


def about_z(angle):
    return np.array([[cos(angle), -sin(angle), 0], [sin(angle), cos(angle), 0], [0, 0, 1]])


def plain_efforts(table, q, v, a, base=None, f_ext=None):
    """Efforts of the rows of a table, in their order.

    Args:
        table: as `mbs.load` takes it, its rows revolute or prismatic.
        q: a number for each row, and so v and a.
        v: velocities.
        a: accelerations.
        base: its motion, none when left out.
        f_ext: (6, rows) wrench of each body on its environment, in its frame.
    """
    base = base or MovingBase()
    fixed = Moved(np.eye(3), *np.zeros((2, 3)), base.w, base.wd, _felt(base, table["gravity"]))
    frames = []
    for j, row in enumerate(table["frame"]):
        before = frames[row["antecedent"] - 1] if row["antecedent"] else fixed
        frames.append(_moved(before, row, q[j], v[j], a[j]))
    forces, moments = np.zeros((2, len(frames), 3))
    efforts = np.array([body["Ia"] for body in table["body"]]) * a
    for j in reversed(range(len(frames))):
        row, frame = table["frame"][j], frames[j]
        own = np.concatenate(_inertial(frame, table["body"][j]))
        if f_ext is not None:
            own += np.concatenate([frame.R @ f_ext[:3, j], frame.R @ f_ext[3:, j]])
        forces[j] += own[:3]
        moments[j] += own[3:]
        efforts[j] += frame.z @ (moments if row["joint"] == "revolute" else forces)[j]
        if row["antecedent"]:
            i = row["antecedent"] - 1
            forces[i] += forces[j]
            moments[i] += moments[j] + np.cross(frame.p - frames[i].p, forces[j])
    return efforts


def _felt(base, gravity):
    """Acceleration of the base, less gravity, in base axes."""
    return base.vd - base.R.T @ np.array(gravity)


def _moved(before, row, q, v, a):
    turns = row["joint"] == "revolute"
    seat = before.R @ about_z(row["gamma"])
    R = seat @ about_x(row["alpha"])
    z = R[:, 2]
    arm = seat @ [row["d"], 0, row["b"]] + (row["r"] + (0 if turns else q)) * z
    w, wd = before.w, before.wd
    vd = before.vd + np.cross(wd, arm) + np.cross(w, np.cross(w, arm))
    if turns:
        w, wd = w + v * z, wd + a * z + np.cross(w, v * z)
    else:
        vd = vd + a * z + 2 * np.cross(w, v * z)
    R = R @ about_z(row["theta"] + (q if turns else 0))
    return Moved(R, before.p + arm, z, w, wd, vd)


def _inertial(frame, body):
    """Force and moment about the origin of the frame that move its body."""
    XX, XY, XZ, YY, YZ, ZZ = (body[key] for key in ("XX", "XY", "XZ", "YY", "YZ", "ZZ"))
    J = frame.R @ np.array([[XX, XY, XZ], [XY, YY, YZ], [XZ, YZ, ZZ]]) @ frame.R.T
    ms = frame.R @ [body["MX"], body["MY"], body["MZ"]]
    w, wd, vd = frame.w, frame.wd, frame.vd
    return (
        body["M"] * vd + np.cross(wd, ms) + np.cross(w, np.cross(w, ms)),
        J @ wd + np.cross(w, J @ w) + np.cross(ms, vd),
    )
