"""Equality constraints of a compiled MuJoCo model: closing joints and couplings."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.polynomial import Polynomial

from mbs.components import Coupling, Fixed, Mechanism, Point, Spherical
from mbs.errors import DescriptionError
from mbs.formats.mujoco_model import MjcfModel, placed


def add_closures(
    mechanism: Mechanism, mjcf: MjcfModel, bodies: Sequence[Point], sites: Sequence[Point]
) -> None:
    """Add what the active equalities say, and open the loops there.

    Args:
        mechanism: with all bodies and joints of the model.
        mjcf: the model.
        bodies: the frames of the bodies, the world first.
        sites: the frames of the sites.

    Raises:
        DescriptionError: an equality is of a kind that mbs does not model.
    """
    model, kinds = mjcf.data, mjcf.mujoco.mjtEq
    if not mjcf.flags.equalities:
        return
    for k in range(model.neq):
        kind = kinds(int(model.eq_type[k]))
        if not model.eq_active0[k]:
            continue
        if kind == kinds.mjEQ_JOINT:
            mechanism.add(_coupling(mjcf, k))
        elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            _close(mechanism, mjcf, k, bodies, sites)
        else:
            name = kind.name.removeprefix("mjEQ_").lower()
            _refuse(mjcf, k, f"it is of the kind {name}; only connect, weld and joint are read")


def _close(
    mechanism: Mechanism,
    mjcf: MjcfModel,
    k: int,
    bodies: Sequence[Point],
    sites: Sequence[Point],
) -> None:
    model, mujoco = mjcf.data, mjcf.mujoco
    one, two = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
    values = [float(value) for value in model.eq_data[k]]
    spherical = mujoco.mjtEq(int(model.eq_type[k])) == mujoco.mjtEq.mjEQ_CONNECT
    if int(model.eq_objtype[k]) == int(mujoco.mjtObj.mjOBJ_SITE):
        a, b = sites[one], sites[two]
    elif spherical:
        a, b = bodies[one].at(*values[:3]), bodies[two].at(*values[3:6])
    else:
        a, b = placed(bodies[one], values[3:6], values[6:10]), bodies[two].at(*values[:3])
    joint = (Spherical if spherical else Fixed)(mjcf.equalities[k], actuated=False)
    mechanism.connect(a, joint, b)
    mechanism.cut(joint)


def _coupling(mjcf: MjcfModel, k: int) -> Coupling:
    """Y - y0 = sum of a_k (x - x0)^k, about the positions in which the joints are drawn."""
    model, kinds = mjcf.data, mjcf.mujoco.mjtJoint
    driven, driver = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
    if driver < 0:
        _refuse(mjcf, k, f"it locks joint {mjcf.joints[driven]!r}; leave the joint out instead")
    for j in (driven, driver):
        if kinds(int(model.jnt_type[j])) not in (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE):
            _refuse(mjcf, k, f"joint {mjcf.joints[j]!r} has not one axis; couple hinges and slides")
    y0, x0 = (float(model.qpos0[model.jnt_qposadr[j]]) for j in (driven, driver))
    polynomial = Polynomial(model.eq_data[k, :5])(Polynomial([-x0, 1.0])) + y0
    coefficients = [float(c) for c in polynomial.trim().coef]
    return Coupling(
        mjcf.equalities[k], mjcf.joints[driven], mjcf.joints[driver], tuple(coefficients)
    )


def _refuse(mjcf: MjcfModel, k: int, reason: str) -> None:
    raise DescriptionError(f"{mjcf.path}: equality {mjcf.equalities[k]!r}: {reason}")
