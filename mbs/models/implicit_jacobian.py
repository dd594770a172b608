"""The direct model with its Jacobian by the implicit formula.

Source: Carpentier & Mansard 2018, section IV.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.assembly.rates import normalised, position_rate, quaternion_slices
from mbs.errors import ModelError
from mbs.models.derivatives import direct_dynamics_derivatives


def with_implicit_jacobian(system: System, ddm: Function) -> Function:
    """The direct model, its Jacobian made by the implicit formula where CasADi asks for it.

    CasADi uses it wherever it takes the Jacobian of a call in an MX graph; directional
    derivatives stay those of algorithmic differentiation, which are cheaper one at a time.
    Quaternions are brought to unit length first, so that every element of q has the derivative
    of a motion; at unit length the model is the same.

    Args:
        system: an open chain.
        ddm: its `direct_dynamics`.

    Returns:
        a Function with the inputs and outputs of ddm.

    Raises:
        ModelError: the system has loops, or ddm is not a direct model of it.
    """
    require_system(system)
    _check(system, ddm)
    names, symbols, output = ddm.name_in(), ddm.sx_in(), ddm.name_out()[0]
    q = symbols[0]
    arguments = [normalised(system.tree, q), *symbols[1:]]
    slopes = direct_dynamics_derivatives(system, with_respect_to=names)
    along_motion, *others = slopes.call(arguments)[:-1]
    jacobian = Function(
        f"jac_{ddm.name()}",
        [*symbols, SX(*ddm.size_out(0))],
        [casadi.densify(casadi.mtimes(along_motion, _velocities(system, q))), *others],
        [*names, f"out_{output}"],
        [f"jac_{output}_{name}" for name in names],
        {"cse": True},
    )
    options: dict[str, Any] = {
        "cse": True,
        "custom_jacobian": jacobian,
        "jac_penalty": 1 / system.nv,
        "default_in": [ddm.default_in(k) for k in range(ddm.n_in())],
    }
    model = Function(ddm.name(), symbols, ddm.call(arguments), names, ddm.name_out(), options)
    like: Callable[[Function], Function] = getattr(ddm, "like", Function)
    return like(model)


def _check(system: System, ddm: Function) -> None:
    if system.is_closed:
        raise ModelError(
            f"{system.name}: the implicit Jacobian is for open chains and this system has loops;"
            " use its direct model as it is"
        )
    wanted = ["q", "v", "tau", *(["p"] if system.parameters else [])]
    if not isinstance(ddm, Function) or ddm.name_in() != wanted or ddm.size1_in(0) != system.nq:
        raise ModelError(
            f"{system.name}: with_implicit_jacobian takes the direct model of the system; give"
            " mbs.models.direct_dynamics(system)"
        )


def _velocities(system: System, q: SX) -> SX:
    """(nv, nq) velocities with which elements of q change, those along no motion left out.

    The rate of q is N v. The columns of N for a turn are half unit vectors, across the
    quaternion; those of a linear velocity are unit vectors.
    """
    u = SX.sym("u", system.nv)
    N = casadi.jacobian(position_rate(system.tree, normalised(system.tree, q), u), u)
    for part in quaternion_slices(system.tree):
        N[part, :] *= 4 / casadi.norm_2(q[part])
    return N.T
