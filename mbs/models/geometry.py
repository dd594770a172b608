"""Direct geometric models: where frames are."""

from __future__ import annotations

import casadi
from casadi import MX, SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import ModelFunction, Named, model_function, require_system
from mbs.errors import ModelError
from mbs.loops.numeric import follow_active
from mbs.recursions.poses import link_poses, relative_pose


def transform(system: System, frame: str | int, relative_to: str | int = "base") -> Function:
    """``transform(q) -> T``: the pose of a frame seen from another one.

    Source: Khalil & Creusot 1997, eq. 1.

    Args:
        system: open or closed; q must close the loops.
        frame: a body, a named frame, or the number of a link (0 is the base).
        relative_to: likewise.

    Returns:
        Function of q (nq, 1); T (4, 4), homogeneous, in m.

    Raises:
        ModelError: there is no such frame.
    """
    require_system(system)
    target, reference = system.frame(frame), system.frame(relative_to)

    def build() -> tuple[Named, Named]:
        q = SX.sym("q", system.nq)
        pose = relative_pose(system.tree, link_poses(system.tree, q), reference, target)
        return [("q", q)], [("T", pose.matrix)]

    return model_function(system, ("transform", frame, relative_to), build)


def terminal_frame(system: System) -> str | int:
    """The frame that a robot is asked for when none is named.

    It is the frame named "tool", else the only frame that was given a name, else the last link.
    """
    bodies = {row.name for row in system.bodies} | {"base", "world"}
    named = [name for name in system.frames if name not in bodies]
    if "tool" in system.frames:
        return "tool"
    return named[0] if len(named) == 1 else len(system.tree.links)


def direct_geometry(system: System, frame: str | int | None = None) -> Function:
    """``dgm(q) -> T``: the pose of the terminal frame seen from the base.

    For a closed system the input is q_a, the positions of the independent joints; the others
    follow by Newton's method from the assembled posture, and a posture that cannot be reached is
    an error of the call.

    Source: Khalil & Creusot 1997, section 3.1.

    Args:
        system: open or closed.
        frame: a body, a named frame, the number of a link, or None for the terminal frame.

    Returns:
        Function of q (nq, 1), or of q_a (m, 1) in a closed system; T (4, 4).

    Raises:
        ModelError: there is no such frame.
    """
    require_system(system)
    name = terminal_frame(system) if frame is None else frame
    pose = transform(system, name)
    if system.is_closed:
        return _closed_geometry(system, name, pose)

    def build() -> tuple[Named, Named]:
        q = SX.sym("q", system.nq)
        placed = relative_pose(
            system.tree, link_poses(system.tree, q), system.frame("base"), system.frame(name)
        )
        return [("q", q)], [("T", placed.matrix)]

    return model_function(system, ("dgm", name), build)


def _closed_geometry(system: System, name: str | int, pose: Function) -> Function:
    def make() -> Function:
        follow = follow_active(system)
        inputs = [MX.sym("q_a", len(system.active))]
        if system.parameters:
            inputs.append(MX.sym("p", len(system.parameters)))
        q = follow(inputs[0], inputs[1] if system.parameters else [])
        T = Function.__call__(pose, q, *inputs[1:])
        names = ["q_a", "p"][: len(inputs)]
        return ModelFunction(Function("dgm", inputs, [casadi.densify(T)], names, ["T"]), system)

    if len(system.coordinates) != len(system.speeds):
        raise ModelError(
            f"{system.name}: the closed geometry of a loop with quaternion joints is not available;"
            " use transform with a posture of mbs.loops.solve"
        )
    function: Function = system.cached(("dgm", name), make)
    return function
