"""Direct geometric models (forward kinematics): poses of frames."""

from __future__ import annotations

import casadi
import numpy as np
from casadi import DM, MX, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import Named, default_in, model_function, require_system
from mbs.components.description import OUTER_WORLD
from mbs.errors import NoClosedForm, Unclosable
from mbs.loops._function import LoopFunction, follow_active
from mbs.loops._function import function as closed_form
from mbs.loops.configuration import solve
from mbs.models.symbols import outputs_of
from mbs.recursions.route import cheapest_pose


def transform(system: System, frame: str | int, relative_to: str | int = "base") -> Function:
    """Return the pose of a frame relative to another frame: ``transform(q) -> T``.

    Source: Khalil & Creusot 1997, eq. 1.

    Args:
        system: open or closed mechanism; q must close the loops.
        frame: name of a body or frame, or index of a link (0 for the base). For a mechanism from a
            table of frames: index of a frame in that table.
        relative_to: reference frame, specified in the same way.

    Returns:
        Function of q (nq, 1); homogeneous matrix T (4, 4), translation in m.

    Raises:
        ModelError: a frame is unknown.
    """
    require_system(system)
    return _pose(system, ("transform", frame, relative_to), frame, relative_to)


def _pose(
    system: System, key: tuple[str | int, ...], frame: str | int, relative_to: str | int
) -> Function:
    """Return the Function ``(q) -> T``: pose (4, 4) of a frame relative to another frame.

    Args:
        system: mechanism.
        key: key of the function in the cache.
        frame: frame whose pose is returned.
        relative_to: reference frame.
    """
    target, reference = system.frame(frame), system.frame(relative_to)

    def build() -> tuple[Named, Named]:
        q = SX.sym("q", system.nq)
        pose = cheapest_pose(system.tree, q, system.p, reference, target)
        return [("q", q)], [("T", pose.matrix)]

    return model_function(system, key, build)


def terminal_frame(system: System) -> str | int:
    """Return the default frame of a robot (end effector), a name or the index of a link.

    It is the frame or body named "tool"; else the only named frame, not counting the frames
    "outer_world" that mounts refer to; else the last link at the end of an open branch; else the
    last link.

    Args:
        system: open or closed mechanism.
    """
    named = [name for name in system.named_frames if name.rpartition(".")[2] != OUTER_WORLD]
    if "tool" in system.frames:
        return "tool"
    if len(named) == 1:
        return named[0]
    shafts = {shaft.coordinate for shaft in system.shafts if shaft.own}
    links = [row.number for row in system.links if row.name not in shafts]
    ends = _open_ends(system)
    links = [number for number in links if number in ends] or links
    last = links[-1] if links else len(system.tree.links)
    if not system.numbered:
        return last
    # frame indices of a table: body of the first frame of the table that is on this link
    return next(name for name in system.numbered.values() if system.frames[name][0] == last - 1)


def _open_ends(system: System) -> set[int]:
    """Return indices (1-based) of the links at the ends of open branches, in no loop."""
    tree = system.tree
    inner = {link.antecedent for link in tree.links}
    inner |= {k for cut in system.cuts for k in tree.path(cut.link_a) + tree.path(cut.link_b)}
    return {k + 1 for k in range(len(tree.links)) if k not in inner}


def direct_geometry(system: System, frame: str | int | None = None) -> Function:
    """Return the pose of a frame relative to the base (forward kinematics): ``dgm(q) -> T``.

    For a closed system the input is q_a, the positions of the independent joints. Other positions
    follow on the branch of the assembled configuration: in closed form if `mbs.loops.function` has
    one, else by continuation in small steps. If this fails, T is NaN, and a call with numbers
    raises Unclosable.

    Source: Khalil & Creusot 1997, section 3.1.

    Args:
        system: open or closed mechanism.
        frame: name of a body or frame, or index of a link. None for "tool", else the only named
            frame, else the last link of an open branch or of the tree.

    Returns:
        Function of q (nq, 1), or of q_a (m, 1) for a closed system; homogeneous matrix T (4, 4),
        translation in m.

    Raises:
        ModelError: the frame is unknown.
        NoClosedForm: an independent velocity belongs to a quaternion joint, whose orientation q_a
            does not contain.
    """
    require_system(system)
    name = terminal_frame(system) if frame is None else frame
    if system.is_closed:
        return _closed_geometry(system, name, transform(system, name))
    return _pose(system, ("dgm", name), name, "base")


def _closed_geometry(system: System, name: str | int, pose: Function) -> Function:
    """Return ``(q_a) -> T`` for a system with loops: closed form of the loops, then the pose.

    Without a closed form, the loops are solved by continuation. `name` is the frame, and `pose` its
    pose as a Function of q.
    """
    try:
        loops = closed_form(system)
    except NoClosedForm:
        return _followed_geometry(system, name, pose)

    def build() -> tuple[Named, Named]:
        q_a = SX.sym("q_a", len(system.chosen_coordinates))
        (q,) = outputs_of(system, loops, q_a)
        return [("q_a", q_a)], [("T", outputs_of(system, pose, q)[0])]

    def make() -> Function:
        return LoopFunction(model_function(system, ("dgm", name), build), system)

    function: Function = system.cached(("closed dgm", name), make)
    return function


class _FollowedGeometry(LoopFunction):
    """Direct geometric model by continuation; its error message reports where the branch ends."""

    def _refusal(self, q_a: NDArray[np.float64], p: NDArray[np.float64]) -> str:
        """Return the error message for independent positions q_a (m,) that cannot be reached."""
        names = [parameter.name for parameter in self.system.parameters]
        try:
            solve(self.system, q_a.tolist(), parameters=dict(zip(names, p.tolist(), strict=True)))
        except Unclosable as error:
            return str(error)
        return f"{self.system.name}: no configuration of the assembled branch has these positions"


def _followed_geometry(system: System, name: str | int, pose: Function) -> Function:
    """Return ``(q_a) -> T`` with the loops solved by continuation from the assembled position.

    `name` is the frame, and `pose` its pose as a Function of q.
    """

    def make() -> Function:
        follow = follow_active(system)
        inputs = [MX.sym("q_a", len(system.chosen_coordinates))]
        if system.parameters:
            inputs.append(MX.sym("p", len(system.parameters)))
        q = follow(inputs[0], inputs[1] if system.parameters else DM(0, 1))
        T = Function.__call__(pose, q, *inputs[1:])
        names = ["q_a", "p"][: len(inputs)]
        options = {"default_in": default_in(system, 1)}
        function = Function("dgm", inputs, [casadi.densify(T)], names, ["T"], options)
        return _FollowedGeometry(function, system)

    function: Function = system.cached(("dgm", name), make)
    return function
