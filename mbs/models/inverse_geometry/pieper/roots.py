"""Steps that find one joint from one equation: of degree 1 or 2 in its form."""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.loops.sequence import Step, step
from mbs.loops.sequence.conics import real_quartic, trigonometric_quartic
from mbs.loops.sequence.step import Found
from mbs.loops.sequence.two_roots import Root, cosine_root, square_root
from mbs.models.inverse_geometry.pieper.forms import PieperLoop

_TINY, _SMALL = 1e-280, 1e-30


def root_of_form(scene: PieperLoop, k: int, form: SX, unit: SX) -> Step | None:
    """Joint k from form = 0; None where the form does not depend on the joint.

    Args:
        scene: whose joint it is.
        k: its number in the ring.
        form: (3, 1) factors, see `forms`.
        unit: of the size of what the form is a sum of, in its unit.
    """
    if not scene.ring.joints[k].turns:
        return _polynomial(scene, k, [form[0], form[1], form[2]], unit)
    if scene.zero(form[:2] / unit):
        return None
    joint = scene.ring.joints[k]
    q, n, sign = joint.name, scene.suffix(k), SX.sym(joint.name)
    root = cosine_root(form[0], form[1], -form[2], sign, unit)
    found = Found(
        {scene.place(k): root.value},
        (root.real,),
        (root.regular,),
        {f"X{n}": form[0], f"Y{n}": form[1], f"Z{n}": -form[2]},
    )
    return step(scene.problem, "type 2", f"X{n} cos({q}) + Y{n} sin({q}) = Z{n}", {q: sign}, found)


def root_of_square(scene: PieperLoop, k: int, A: SX, unit: SX) -> Step | None:
    """Joint k from b^T A b = 0; None where it does not depend on the joint.

    Args:
        scene: whose joint it is.
        k: its number in the ring.
        A: (3, 3) symmetric, factors of the products, see `forms`.
        unit: of the size of what it is a sum of, in its unit.
    """
    if not scene.ring.joints[k].turns:
        powers = [A[0, 0], 2 * A[0, 1], A[1, 1] + 2 * A[0, 2], 2 * A[1, 2], A[2, 2]]
        return _polynomial(scene, k, powers, unit)
    mean = (A[0, 0] + A[1, 1]) / 2
    a = casadi.vertcat((A[0, 0] - A[1, 1]) / 2, A[0, 1], 2 * A[0, 2], 2 * A[1, 2], A[2, 2] + mean)
    if scene.zero(a[:2] / unit):
        return root_of_form(scene, k, a[2:], unit)
    joint = scene.ring.joints[k]
    q, n = joint.name, scene.suffix(k)
    signs = {f"{q}a": SX.sym(f"{q}a"), q: SX.sym(q)}
    root = trigonometric_quartic(a, casadi.vertcat(*signs.values()), unit)
    named = dict(zip((f"A{n}", f"B{n}", f"X{n}", f"Y{n}"), casadi.vertsplit(a[:4]), strict=True))
    named[f"Z{n}"] = -a[4]
    text = f"A{n} cos(2 {q}) + B{n} sin(2 {q}) + X{n} cos({q}) + Y{n} sin({q}) = Z{n}"
    found = Found({scene.place(k): root.value}, (root.real,), (root.regular,), named)
    return step(scene.problem, "quartic", text, signs, found)


def linear(scene: PieperLoop, k: int, factor: SX, value: SX, scale: SX | float = 1.0) -> Step:
    """A joint that slides, from factor x = value.

    Args:
        scene: whose joint it is.
        k: its number in the ring.
        factor: of the position.
        value: the right side [m], times the unit of the factor.
        scale: of the size of the factor, in its unit.
    """
    joint = scene.ring.joints[k]
    r, n, size = joint.name, scene.suffix(k), factor / scale
    x = value / scale * size / (size * size + _TINY)
    regular = () if factor.is_constant() else (size * size,)
    found = Found({scene.place(k): x}, (), regular, {f"X{n}": factor, f"Y{n}": value})
    return step(scene.problem, "type 1", f"X{n} {r} = Y{n}", {}, found)


def _polynomial(scene: PieperLoop, k: int, factors: list[SX], unit: SX) -> Step | None:
    """A joint that slides, from a polynomial; factors from the highest power."""
    degree = len(factors) - 1
    while degree and scene.zero(factors[0] * scene.length**degree / unit):
        factors, degree = factors[1:], degree - 1
    if not degree:
        return None
    joint = scene.ring.joints[k]
    r, n = joint.name, scene.suffix(k)
    named = {f"{letter}{n}": factor for letter, factor in zip("ABCDE", factors, strict=False)}
    if degree == 1:
        return linear(scene, k, factors[0], -factors[1], unit / scene.length)
    text = _polynomial_text(list(named), r)
    signs = {name: SX.sym(name) for name in ((r,) if degree == 2 else (f"{r}a", r))}
    if degree == 2:
        root = _quadratic_root(factors, signs[r], scene.length, unit)
    else:
        five = casadi.vertcat(*[SX(0)] * (4 - degree), *factors)
        both = casadi.vertcat(*signs.values())
        root = real_quartic(five, both, scene.length, unit)
    found = Found({scene.place(k): root.value}, (root.real,), (root.regular,), named)
    kind = "quadratic" if degree == 2 else "quartic"
    return step(scene.problem, kind, text, signs, found)


def _polynomial_text(names: list[str], r: str) -> str:
    """The equation, such as "A3 r3^2 + B3 r3 + C3 = 0"."""
    powers = [f" {r}^{k}" if k > 1 else f" {r}" for k in range(len(names) - 1, 0, -1)]
    return (
        " + ".join(f"{name}{power}" for name, power in zip(names, [*powers, ""], strict=True))
        + " = 0"
    )


def _quadratic_root(factors: list[SX], sign: SX, length: SX, unit: SX) -> Root:
    """The root of a r^2 + b r + c on one side of the middle, finite for every a."""
    a, b, c = factors[0] * length**2 / unit, factors[1] * length / unit, factors[2] / unit
    inverse = a / (a * a + _SMALL)
    middle = -b * inverse / 2
    root = square_root(middle * middle - c * inverse, sign)
    size = middle * middle + casadi.fabs(c * inverse) + _TINY
    return Root(SX((middle + root.value) * length), SX(root.real / size), SX(a * a))
