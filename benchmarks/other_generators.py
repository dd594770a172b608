"""C code of other generators, made by a Python that has them and compiled as ours is.

Run as a program it is that Python's part: it saves casadi.Functions made from a URDF file.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

GENERATORS = ("adam", "urdf2casadi")
SECONDS = 600


def generated_by_others(
    python: str, model: Any, folder: Path
) -> dict[str, dict[str, tuple[Path, Any]]]:
    """For each algorithm and generator the library and the Function; only arms on a fixed base.

    Args:
        python: has adam-robotics, urdf2casadi or both, and this casadi.
        model: of pinocchio.
        folder: where to write.
    """
    import casadi

    from mbs.native import cached_library
    from mbs.native._compiled import generated
    from mbs.native.kernel import FAST_FLAGS

    if model.nq != model.nv or any(list(model.parents)[1:][k] != k for k in range(model.nv)):
        return {}
    file = folder / f"others_{model.nv}.urdf"
    file.write_text(_urdf(model), encoding="utf-8")
    result: dict[str, dict[str, tuple[Path, Any]]] = {}
    for generator in GENERATORS:
        armature = json.dumps([float(x) for x in model.armature])
        gravity = json.dumps([float(x) for x in model.gravity.linear])
        program = [python, __file__, generator, str(file), armature, gravity]
        answer = subprocess.run(program, capture_output=True, text=True, timeout=SECONDS)
        if answer.returncode != 0:
            print(f"{generator} is left out: {answer.stderr.strip()[-200:]}", file=sys.stderr)
            continue
        for algorithm, saved in json.loads(answer.stdout.splitlines()[-1]).items():
            function = casadi.Function.load(saved)
            library = cached_library({"function.c": generated([function])}, FAST_FLAGS)
            result.setdefault(algorithm, {})[generator] = (library, function)
    return result


def _urdf(model: Any) -> str:
    """URDF text of a serial arm whose joints are about or along z."""
    import pinocchio as pin
    from robots import AXES

    parts = ['<robot name="arm">', '<link name="world"/>']
    for k in range(1, model.njoints):
        body, place = model.inertias[k], model.jointPlacements[k]
        kind = "prismatic" if "P" in model.joints[k].shortname()[10:] else "revolute"
        I, xyz = body.inertia, _text(place.translation)  # noqa: E741
        numbers = zip(("xx", "xy", "xz", "yy", "yz", "zz"), _upper(I), strict=True)
        tensor = " ".join(f'i{name}="{x!r}"' for name, x in numbers)
        rpy = _text(pin.rpy.matrixToRpy(place.rotation))
        parent = "world" if k == 1 else f"l{k - 1}"
        parts += [
            f'<link name="l{k}"><inertial><origin xyz="{_text(body.lever)}" rpy="0 0 0"/>'
            f'<mass value="{float(body.mass)!r}"/><inertia {tensor}/></inertial></link>',
            f'<joint name="j{k}" type="{kind}"><parent link="{parent}"/><child link="l{k}"/>'
            f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{AXES["z"]}"/>'
            '<limit lower="-3" upper="3" effort="1000" velocity="100"/></joint>',
        ]
    return "\n".join([*parts, "</robot>"])


def _upper(matrix: Any) -> list[float]:
    return [float(matrix[a, b]) for a in range(3) for b in range(a, 3)]


def _text(values: Any) -> str:
    return " ".join(repr(float(x)) for x in values)


def _save(generator: str, file: str, armature: list[float], gravity: list[float]) -> None:
    """What the other Python does: save the Functions and print where."""
    import casadi as ca

    n = len(armature)
    q, v, x = (ca.SX.sym(name, n) for name in "qvx")
    make = _adam if generator == "adam" else _urdf2casadi
    outputs = make(file, n, gravity, q, v, x)
    rotors = ca.diag(ca.SX(armature))
    if "IDM" in outputs:
        outputs["IDM"] += ca.mtimes(rotors, x)
    outputs["A"] += rotors
    saved = {}
    for algorithm, value in outputs.items():
        name = f"{generator}_{algorithm}"
        inputs = [q] if algorithm == "A" else [q, v, x]
        function = ca.Function(name, inputs, [ca.densify(value)], {"cse": True})
        saved[algorithm] = f"{file}.{name}"
        function.save(saved[algorithm])
    print(json.dumps(saved))


def _adam(file: str, n: int, gravity: list[float], q: Any, v: Any, x: Any) -> dict[str, Any]:
    from types import ModuleType

    import casadi as ca
    import numpy as np

    if "liecasadi" not in sys.modules:  # adam imports it, for inverse kinematics alone
        sys.modules["liecasadi"] = ModuleType("liecasadi")
        sys.modules["liecasadi"].__dict__.update(SO3=None, SE3=None)
    from adam.casadi import KinDynComputations

    kindyn = KinDynComputations(file, [f"j{k + 1}" for k in range(n)])
    kindyn.g = np.array([*gravity, 0.0, 0.0, 0.0])
    base, rest = ca.SX.eye(4), ca.SX.zeros(6)
    A = kindyn.mass_matrix_fun()(base, q)[6:, 6:]
    bias = kindyn.bias_force_fun()(base, q, rest, v)[6:]
    return {"IDM": ca.mtimes(A, x) + bias, "A": A}


def _urdf2casadi(file: str, n: int, gravity: list[float], q: Any, v: Any, x: Any) -> dict[str, Any]:
    from urdf2casadi import urdfparser

    robot = urdfparser.URDFparser()
    robot.from_file(file)
    ends = "world", f"l{n}"
    return {
        "IDM": robot.get_inverse_dynamics_rnea(*ends, gravity)(q, v, x),
        "A": robot.get_inertia_matrix_crba(*ends)(q),
        "DDM": robot.get_forward_dynamics_aba(*ends, gravity)(q, v, x),
    }


if __name__ == "__main__":
    _save(sys.argv[1], sys.argv[2], json.loads(sys.argv[3]), json.loads(sys.argv[4]))
