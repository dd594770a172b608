"""Equations of motion on a `rockit.Ocp` or one of its stages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from casadi import DM, MX

from mbs.bridges.explicit import require_dae
from mbs.bridges.opti import CODES, parameter_values
from mbs.errors import ModelError
from mbs.models._dae import Dae
from mbs.text import quoted


@dataclass(frozen=True, slots=True, eq=False)
class RockitStage:
    """Signals of a rockit stage.

    Attributes:
        x: (nx, 1) differential states.
        z: (nz, 1) algebraic states.
        u: (nu, 1) efforts.
        p: (np, 1) parameters.
        q: (nq, 1) positions of the tree, for constraints on paths and poses.
        v: (nv, 1) velocities of the tree.
        invariants: constraint residuals. Add `stage.at_t0(invariants) == 0` if x is not fixed at
            the start.
    """

    x: MX
    z: MX
    u: MX
    p: MX
    q: MX
    v: MX
    invariants: MX


def rockit_stage(stage: Any, dae: Dae, *, code: str = "interpreted", p: Any = None) -> RockitStage:
    """Add states, controls, parameters and the equations of a Dae to a rockit stage.

    The equations are set by `set_der` and `add_alg`. The method of rockit is chosen by the user:
    "reduced" is compatible with all methods, forms with algebraic states with `DirectCollocation`.
    Initial guesses are the start values of the Dae.

    Args:
        stage: `rockit.Ocp` or `rockit.Stage`.
        dae: equations, in any form that the method supports.
        code: "interpreted", or "compiled" for machine code of the equations with exact first and
            second derivatives.
        p: parameters: an expression of the stage, such as `stage.variable(np)`, a vector of
            numbers, or a dict of numbers by name. By default they are `stage.parameter`, set to the
            default values.

    Returns:
        Signals of the stage.

    Raises:
        ModelError: `code` is unknown, `dae` is not a Dae, or the number of parameters is wrong.
    """
    require_dae(dae)
    if code not in CODES:
        raise ModelError(f"code is {quoted(code)}; use one of {', '.join(CODES)}")
    function = CODES[code](dae.function())
    x = stage.state(dae.x.numel())
    z = stage.algebraic(dae.z.numel()) if dae.z.numel() else MX(0, 1)
    u = stage.control(dae.u.numel()) if dae.u.numel() else MX(0, 1)
    p = _parameters(stage, dae, p)
    ode, alg, invariants, q, v = function(x, z, u, p)
    stage.set_der(x, ode)
    stage.set_initial(x, DM(dae.x0))
    if dae.z.numel():
        stage.add_alg(alg)
        stage.set_initial(z, DM(dae.z0))
    if dae.u.numel():
        stage.set_initial(u, DM(dae.u0))
    return RockitStage(x, z, u, p, q, v, invariants)


def _parameters(stage: Any, dae: Dae, given: Any) -> MX:
    """Return the given parameters, or else new parameters of the stage."""
    if given is not None or not dae.p.numel():
        return parameter_values(dae, dae.p.numel(), given)
    p: MX = stage.parameter(dae.p.numel())
    stage.set_value(p, DM(dae.p0))
    return p
