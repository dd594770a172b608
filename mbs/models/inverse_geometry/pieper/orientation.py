"""Three turns whose axes meet, or are taken by themselves, from the rotation they make.

Z(q1) A Z(q2) B Z(q3) = G; the element G_zz holds the middle one alone.

Source: Pieper 1968; Khalil & Creusot 1997, section 3.3 for the types of equations.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi
from casadi import SX

from mbs.loops.sequence import Step, step
from mbs.loops.sequence.step import Found
from mbs.loops.sequence.two_roots import Root, cosine_root
from mbs.models.inverse_geometry.pieper.forms import PieperLoop
from mbs.spatial import axis_turn


def three_turns(scene: PieperLoop, turns: tuple[int, int, int], A: SX, B: SX, G: SX) -> list[Step]:
    """The steps of three joints that turn.

    Args:
        scene: whose joints they are.
        turns: their numbers in the ring.
        A: (3, 3) rotation between the first two; no turn about z.
        B: (3, 3) rotation between the last two, likewise.
        G: (3, 3) what they make, of joints that are known.
    """
    first, middle, last = turns
    Z1, Z2 = (_turn(scene, k) for k in (first, middle))
    seen = casadi.mtimes([A, Z2, B])
    column = casadi.mtimes([Z1, seen]).T @ G[:, 0]
    return [
        _middle(scene, middle, A[2, :].T, B[:, 2], G),
        _outer(scene, first, seen[:2, 2], G[:2, 2]),
        _outer(scene, last, SX(casadi.vertcat(1, 0)), column[:2]),
    ]


def _turn(scene: PieperLoop, k: int) -> SX:
    return SX(axis_turn("z", scene.ring.joints[k].sign * scene.x(k)).matrix)


def _middle(scene: PieperLoop, k: int, row: SX, column: SX, G: SX) -> Step:
    """The joint in the middle, from row^T Z column = G_zz."""
    joint = scene.ring.joints[k]
    sign = SX.sym(joint.name)
    X = row[0] * column[0] + row[1] * column[1]
    Y = joint.sign * (row[1] * column[0] - row[0] * column[1])
    Z = G[2, 2] - row[2] * column[2]
    square = scene.zero(casadi.vertcat(row[2], column[2]))
    root = _square_angle(X, Y, Z, sign, G) if square else cosine_root(X, Y, Z, sign)
    end = scene.suffix(k)
    found = Found(
        {scene.place(k): root.value},
        () if square else (root.real,),
        (root.regular,),
        {f"X{end}": X, f"Y{end}": Y, f"Z{end}": Z},
    )
    q = joint.name
    text = f"X{end} cos({q}) + Y{end} sin({q}) = Z{end}"
    return step(scene.problem, "type 2", text, {q: sign}, found)


def _square_angle(X: SX, Y: SX, Z: SX, sign: SX, G: SX) -> Root:
    """The root where both neighbours are at right angles: X^2 + Y^2 = 1, Z^2 + W^2 = 1."""
    W = sign * casadi.sqrt(G[0, 2] * G[0, 2] + G[1, 2] * G[1, 2])
    angle = casadi.atan2(Y * Z + X * W, X * Z - Y * W)
    return Root(SX(angle), SX(1), SX(1))


def _outer(scene: PieperLoop, k: int, start: SX, end: SX) -> Step:
    return turn_onto(scene, k, (start, end), 1.0)


def turn_onto(
    scene: PieperLoop, k: int, vectors: tuple[SX, SX], scale: SX | float, regular: Sequence[SX] = ()
) -> Step:
    """The turn of joint k that brings one vector of the plane onto the direction of another.

    Args:
        scene: whose joint it is.
        k: its number in the ring.
        vectors: (2, 1) before the turn, and (2, 1) after it, of the same length.
        scale: of the size of both, in their unit.
        regular: what else must not vanish, free of units.
    """
    joint = scene.ring.joints[k]
    start, end = vectors
    s = joint.sign
    X, Y, U, V = start[0], s * start[1], end[0], s * end[1]
    value = SX(casadi.atan2(V * X - U * Y, U * X + V * Y))
    size = (U * U + V * V) / (scale * scale)
    q, n = joint.name, scene.suffix(k)
    text = f"X{n} cos({q}) - Y{n} sin({q}) = U{n}, Y{n} cos({q}) + X{n} sin({q}) = V{n}"
    coefficients = {f"X{n}": X, f"Y{n}": Y, f"U{n}": U, f"V{n}": V}
    found = Found({scene.place(k): value}, (), (size, *regular), coefficients)
    return step(scene.problem, "type 3", text, {}, found)
