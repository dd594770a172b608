"""Positions of the whole tree from those of the independent joints, as a CasADi graph."""

import casadi
from casadi import DM, MX, SX, Function

from mbs.assembly import System
from mbs.errors import NoClosedForm
from mbs.loops.closed_form.places import independent_places
from mbs.loops.closing import closure_parameters
from mbs.loops.closure import facing, square_closure
from mbs.loops.continuation import LARGEST_MOVE
from mbs.loops.sizes import relative_rows, row_sizes

_STAGES = 128
_OPEN = 1e-9
"""Sum of all rows, in parts of the size of the mechanism, where Newton's method ended: it leaves
1e-13, or has missed by far."""


def follow_active(system: System) -> Function:
    """``follow(q_a, p) -> q``: the posture reached from the assembled one along a straight line.

    The independent positions, and the parameters from their defaults, are moved in small equal
    stages, each closed by Newton's method from where the slope led: the branch of the assembled
    posture is kept, and the Function is differentiable (implicit function theorem). Where the
    line leaves what the mechanism can reach, q is NaN.

    Returns:
        Function of q_a (m, 1) and p (np, 1); q (nq, 1).

    Raises:
        NoClosedForm: an independent velocity belongs to a quaternion, so that no position of q
            stands for it.
    """

    def build() -> Function:
        active = independent_places(system)
        if any(place >= system.nq for place in active):
            raise NoClosedForm(
                f"{system.name}: a rod spins about its line, which no position of q follows; use a"
                " posture of mbs.loops.solve"
            )
        passive = [k for k in range(system.nq) if k not in active]
        q_a, p = MX.sym("q_a", len(active)), MX.sym("p", system.p.numel())
        q_start = DM([system.posture[k] for k in active])
        p_start = DM(closure_parameters(system))
        stage = _stage(system, active, passive)
        z = before = MX(DM([system.posture[k] for k in passive]))
        good: MX = MX(1)
        for number in range(1, _STAGES + 1):
            part = number / _STAGES
            q_k, p_k = q_start + part * (q_a - q_start), p_start + part * (p - p_start)
            led = 2 * z - before
            before = z
            z, closed = stage(led, q_k, p_k)
            good = good * closed
        q = _merged(system, active, passive)(z, q_a)
        return Function("follow", [q_a, p], [casadi.if_else(good, q, DM.nan(system.nq))])

    function: Function = system.cached("follow", build)
    return function


def _merged(system: System, active: list[int], passive: list[int]) -> Function:
    z, q_a = SX.sym("z", len(passive)), SX.sym("q_a", len(active))
    q = SX.zeros(system.nq)
    q[passive], q[active] = z, q_a
    return Function("merged", [z, q_a], [q])


def _newton(system: System, active: list[int], passive: list[int]) -> Function:
    q, z, q_a = (
        SX.sym(n, k) for n, k in zip("qza", (system.nq, len(passive), len(active)), strict=True)
    )
    merged = _merged(system, active, passive)(z, q_a)
    rows = square_closure(system, q, passive)
    if system.closure is not None and not system.closure.varies:
        own = row_sizes(system)[list(system.closure.rows)]
        rows = casadi.vertcat(rows[: own.numel(), 0] / own, rows[own.numel() :, 0])
    residual = casadi.substitute(rows, q, merged)
    equations = Function("phi", [z, q_a, system.p], [residual])
    options = {"abstol": 1e-13, "max_iter": 30, "error_on_fail": False}
    return casadi.rootfinder("newton", "fast_newton", equations, options)


def _stage(system: System, active: list[int], passive: list[int]) -> Function:
    """``stage(led, q_a, p) -> z, good``: closed by Newton's method from the prediction."""
    led, q_a = MX.sym("led", len(passive)), MX.sym("q_a", len(active))
    p = MX.sym("p", system.p.numel())
    z = _newton(system, active, passive)(led, q_a, p)
    q = _merged(system, active, passive)(z, q_a)
    near = casadi.norm_inf(z - led) < LARGEST_MOVE
    good = casadi.logic_and(_closed(system)(q, p), near)
    return Function("stage", [led, q_a, p], [z, good])


def _closed(system: System) -> Function:
    """1 where every row is closed and no axis is opposed, else 0; NaN counts as open."""
    q = SX.sym("q", system.nq)
    openness = casadi.sum1(casadi.fabs(relative_rows(system, q)))  # a maximum would drop NaN
    cosines = facing(system, q)
    faces = casadi.mmin(cosines) > 0 if cosines.numel() else SX(1)
    return Function("closed", [q, system.p], [casadi.logic_and(openness < _OPEN, faces)])
