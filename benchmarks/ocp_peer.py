"""Inverse dynamics of other generators, made by a Python that has them.

Run as a program it is that Python's part: it saves a casadi.Function made from a URDF file.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

SECONDS = 300


def adam_inverse_dynamics(python: str, file: Path, joints: list[str]) -> Any:
    """``idm(q, v, a) -> tau`` of adam, in scalar operations; adam has no recursion for it.

    Args:
        python: has adam-robotics and this casadi.
        file: URDF text of an arm on a fixed base.
        joints: names, in the order of q.
    """
    return _made(python, "adam", file, joints)


def kin_dyn_inverse_dynamics(python: str, file: Path, joints: list[str]) -> Any:
    """``idm(q, v, a) -> tau`` of casadi-kin-dyn: pinocchio's recursion on CasADi's scalars.

    Args:
        python: has cmeel-casadi-kin-dyn; its own casadi may be an older one.
        file: URDF text of an arm on a fixed base.
        joints: names, in the order of q.
    """
    return _made(python, "kin_dyn", file, joints)


def _made(python: str, peer: str, file: Path, joints: list[str]) -> Any:
    import casadi

    target = file.with_suffix(f".{peer}")
    command = [python, __file__, peer, str(file), str(target), *joints]
    subprocess.run(command, check=True, timeout=SECONDS, capture_output=True)
    return casadi.Function.load(str(target))


def _save_kin_dyn(file: str, target: str, joints: list[str]) -> None:
    from casadi_kin_dyn import casadi_kin_dyn

    model = casadi_kin_dyn.CasadiKinDyn(Path(file).read_text(encoding="utf-8"))
    if list(model.joint_names())[1:] != joints:
        raise ValueError(f"casadi-kin-dyn orders the joints {model.joint_names()}")
    model.rnea().save(target)


def _save_adam(file: str, target: str, joints: list[str]) -> None:
    import casadi as ca
    import numpy as np

    if "liecasadi" not in sys.modules:  # adam imports it, for inverse kinematics alone
        try:
            import liecasadi  # noqa: F401
        except ImportError:
            sys.modules["liecasadi"] = ModuleType("liecasadi")
            sys.modules["liecasadi"].__dict__.update(SO3=None, SE3=None)
    from adam.casadi import KinDynComputations

    kindyn = KinDynComputations(file, joints)
    kindyn.g = np.array([0, 0, -9.81, 0, 0, 0])
    q, v, a = (ca.SX.sym(name, len(joints)) for name in "qva")
    base, rest = ca.SX.eye(4), ca.SX.zeros(6)
    A = kindyn.mass_matrix_fun()(base, q)[6:, 6:]
    tau = ca.mtimes(A, a) + kindyn.bias_force_fun()(base, q, rest, v)[6:]
    ca.Function("idm", [q, v, a], [ca.densify(tau)], ["q", "v", "a"], ["tau"]).save(target)


if __name__ == "__main__":
    save = {"adam": _save_adam, "kin_dyn": _save_kin_dyn}[sys.argv[1]]
    save(sys.argv[2], sys.argv[3], sys.argv[4:])
