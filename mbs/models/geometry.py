"""Direct geometric models: where frames are."""

from __future__ import annotations

import casadi
import numpy as np
from casadi import DM, MX, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import Named, default_in, model_function, require_system
from mbs.components.description import OUTER_WORLD
from mbs.errors import NoClosedForm, Unclosable
from mbs.loops.configuration import solve
from mbs.loops.function import LoopFunction, follow_active
from mbs.loops.function import function as closed_form
from mbs.models.symbols import outputs_of
from mbs.recursions.route import cheapest_pose


def transform(system: System, frame: str | int, relative_to: str | int = "base") -> Function:
    """``transform(q) -> T``: the pose of a frame seen from another one.

    Source: Khalil & Creusot 1997, eq. 1.

    Args:
        system: open or closed; q must close the loops.
        frame: a body, a named frame, or the number of a link (0 is the base); of a mechanism that
            was made from a table of frames, the number of a frame there.
        relative_to: likewise.

    Returns:
        Function of q (nq, 1); T (4, 4), homogeneous, in m.

    Raises:
        ModelError: there is no such frame.
    """
    require_system(system)
    return _pose(system, ("transform", frame, relative_to), frame, relative_to)


def _pose(
    system: System, key: tuple[str | int, ...], frame: str | int, relative_to: str | int
) -> Function:
    target, reference = system.frame(frame), system.frame(relative_to)

    def build() -> tuple[Named, Named]:
        q = SX.sym("q", system.nq)
        pose = cheapest_pose(system.tree, q, system.p, reference, target)
        return [("q", q)], [("T", pose.matrix)]

    return model_function(system, key, build)


def terminal_frame(system: System) -> str | int:
    """The frame that a robot is asked for when none is named.

    It is the frame or body named "tool", else the only frame that was given a name, not counting
    those in which mounts are given ("outer_world"), else the last
    link at the end of a chain that no loop goes through, else the last link.
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
    # Numbers are those of a table: the body of its first frame that this link carries.
    return next(name for name in system.numbered.values() if system.frames[name][0] == last - 1)


def _open_ends(system: System) -> set[int]:
    """The numbers of the links that carry no other link and stand in no loop."""
    tree = system.tree
    inner = {link.antecedent for link in tree.links}
    inner |= {k for cut in system.cuts for k in tree.path(cut.link_a) + tree.path(cut.link_b)}
    return {k + 1 for k in range(len(tree.links)) if k not in inner}


def direct_geometry(system: System, frame: str | int | None = None) -> Function:
    """``dgm(q) -> T``: the pose of the terminal frame seen from the base.

    For a closed system the input is q_a, the positions of the independent joints; the others
    follow on the branch of the assembled configuration: in closed form where `mbs.loops.function`
    knows one, else in small steps. Where that leads nowhere T is NaN, and a call with numbers
    raises Unclosable.

    Source: Khalil & Creusot 1997, section 3.1.

    Args:
        system: open or closed.
        frame: a body, a named frame, the number of a link, or None for the terminal frame.

    Returns:
        Function of q (nq, 1), or of q_a (m, 1) in a closed system; T (4, 4).

    Raises:
        ModelError: there is no such frame.
        NoClosedForm: a quaternion turns freely, so that q_a does not say how it stands.
    """
    require_system(system)
    name = terminal_frame(system) if frame is None else frame
    if system.is_closed:
        return _closed_geometry(system, name, transform(system, name))
    return _pose(system, ("dgm", name), name, "base")


def _closed_geometry(system: System, name: str | int, pose: Function) -> Function:
    try:
        loops = closed_form(system)
    except NoClosedForm:
        return _followed_geometry(system, name, pose)

    def build() -> tuple[Named, Named]:
        q_a = SX.sym("q_a", len(system.free))
        (q,) = outputs_of(system, loops, q_a)
        return [("q_a", q_a)], [("T", outputs_of(system, pose, q)[0])]

    def make() -> Function:
        return LoopFunction(model_function(system, ("dgm", name), build), system)

    function: Function = system.cached(("closed dgm", name), make)
    return function


class _FollowedGeometry(LoopFunction):
    """The geometry of a system that is followed in steps; a refusal says where its branch ends."""

    def _refusal(self, q_a: NDArray[np.float64], p: NDArray[np.float64]) -> str:
        names = [parameter.name for parameter in self.system.parameters]
        try:
            solve(self.system, q_a.tolist(), parameters=dict(zip(names, p.tolist(), strict=True)))
        except Unclosable as error:
            return str(error)
        return f"{self.system.name}: no configuration of the assembled branch has these positions"


def _followed_geometry(system: System, name: str | int, pose: Function) -> Function:
    def make() -> Function:
        follow = follow_active(system)
        inputs = [MX.sym("q_a", len(system.free))]
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
