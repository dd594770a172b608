"""Every public builder of a Function, and mechanisms that each of them takes."""

from __future__ import annotations

import inspect

import casadi
import numpy as np
from support.closed_mechanisms import planar_loop
from support.dae_mechanisms import CLOSED, OPEN
from support.driven_trees import driven_tree
from support.immobile_loops import triangle
from support.random_trees import random_state

import mbs
import mbs.models
from mbs import identification, loops, models
from mbs.components import DCMotor, JointSensor
from mbs.models import ContactPoint, contact_phases, inverse_geometry


def phases(system):
    return contact_phases(system, [ContactPoint("tip", len(system.links), friction=0.5)])


def standing(system):
    """Equations of the last link's frame at rest on a plane through the assembled configuration."""
    q = dict(zip((c.name for c in system.coordinates), system.configuration, strict=True))
    return phases(system).dae((), "index1", q0=q)


def last(builder, **options):
    return lambda s: builder(s, len(s.links), **options)


BUILDERS = {
    "bias": models.bias,
    "direct_dynamics": models.direct_dynamics,
    "direct_dynamics, tree": lambda s: models.direct_dynamics(s, coordinates="tree"),
    "direct_dynamics_derivatives": models.direct_dynamics_derivatives,
    "actuation_matrix": models.actuation_matrix,
    "actuation_null_space": models.actuation_null_space,
    "validity": models.validity,
    "energy": models.energy,
    "gravity_effort": models.gravity_effort,
    "hybrid_dynamics": lambda s: models.hybrid_dynamics(
        s, [s.velocity_coordinates[s.independent[0]].name]
    ),
    "inertia_matrix": models.inertia_matrix,
    "inverse_dynamics": models.inverse_dynamics,
    "inverse_dynamics, tree": lambda s: models.inverse_dynamics(s, "tree"),
    "inverse_dynamics, wrenches": lambda s: models.inverse_dynamics(
        s, f_ext=True, moving_base=True
    ),
    "inverse_dynamics_derivatives": models.inverse_dynamics_derivatives,
    "jacobian": last(models.jacobian),
    "jacobian_dot_velocity": last(models.jacobian_dot_velocity),
    "joint_wrenches": models.joint_wrenches,
    "lagrange": models.lagrange,
    "linearise": lambda s: models.linearise(s).function,
    "link_accelerations": models.link_accelerations,
    "link_velocities": models.link_velocities,
    "transform": last(models.transform),
    "phase": lambda s: phases(s).accelerations("tip"),
    "phase_residuals": lambda s: phases(s).residuals("tip"),
    "touchdown": lambda s: phases(s).impact({"tip": "sliding"}),
    "points": lambda s: phases(s).motion(),
    "cone": lambda s: phases(s).friction(),
    "dae, reduced": lambda s: models.dae(s).function(),
    "dae, ggl": lambda s: models.dae(s, "ggl").function(),
    "dae of a phase": lambda s: standing(s).function(),
    "regressor": identification.regressor,
    "filtered_regressor": identification.filtered_regressor,
    "energy_regressor": identification.energy_regressor,
    "power_regressor": identification.power_regressor,
    "known_efforts": identification.known_efforts,
}
"""By a name that begins with the builder's: what makes the Function of any system."""

CLOSED_ALONE = {
    "acceleration_closure": models.acceleration_closure,
    "velocity_closure": models.velocity_closure,
    "closure_residual": loops.closure_residual,
    "closure_jacobian": loops.closure_jacobian,
    "reduction_matrix": loops.reduction_matrix,
}
"""What systems with loops have."""

OPEN_ALONE = {
    "direct_geometry": last(models.direct_geometry),
    "with_implicit_jacobian": lambda s: models.with_implicit_jacobian(s, models.direct_dynamics(s)),
}
"""What systems without loops have."""

ALONE = {
    "rx90": {
        "inverse_jacobian": last(models.inverse_jacobian),
        "inverse_differential_kinematics": last(models.inverse_differential_kinematics),
        "jacobian_determinant": last(models.jacobian_determinant),
        "inverse_geometry.function": inverse_geometry.function,
    },
    "four_bar": {
        "function": loops.function,
        "direct_geometry": last(models.direct_geometry),
    },
    "observed": {"measurements": models.measurements, "devices": models.devices},
    "still_triangle": {"measurements": models.measurements},
    "turning_triangle": {"measurements": models.measurements},
}
"""What not every mechanism has, by the mechanism."""

AGAIN = {
    *("regressor", "filtered_regressor", "energy_regressor", "power_regressor"),
    *("cone", "dae, reduced", "dae, ggl", "dae of a phase", "with_implicit_jacobian"),
}
"""Builders that make a new Function at every call, of equations that are kept."""


def observed():
    """An arm with a motor and sensors."""
    m = mbs.load("planar_2r")
    name, joint = next((joint.name, joint) for joint in m.joints())
    motor = dict(resistance=0.5, inductance=1e-3, constant=0.1, inertia=1e-4)
    m.connect(m.add(DCMotor("motor", **motor)).flange, joint.flange)
    m.add(JointSensor("encoder", name))
    return m.assemble()


def planar():
    """A random planar loop of five bars."""
    mechanism, guess = planar_loop(3, 4)
    return mechanism.assemble(guess=guess)


SYSTEMS = {
    **OPEN,
    "driven": lambda: driven_tree(4).assemble(),
    "loop": planar,
    **{n: CLOSED[n] for n in ("four_bar", "rssr", "rolling")},
    "observed": observed,
    "still_triangle": lambda: triangle(moves=False, rigid=False),
    "turning_triangle": lambda: triangle(moves=True, rigid=False),
}
"""Trees and loops, seeded; with quaternions, symbols, springs, rotors, friction, rolling."""

LOOPS = ("loop", "four_bar", "rssr", "rolling", "still_triangle", "turning_triangle")

PAIRS = [
    (name, builder)
    for name in SYSTEMS
    for builder in (
        *(BUILDERS if name != "observed" else {}),
        *(CLOSED_ALONE if name in LOOPS else OPEN_ALONE if name != "observed" else {}),
        *ALONE.get(name, {}),
    )
]

_BUILT = {}


def system_of(name):
    if name not in _BUILT:
        _BUILT[name] = SYSTEMS[name]()
    return _BUILT[name]


def built(name, builder):
    every = {**BUILDERS, **CLOSED_ALONE, **OPEN_ALONE, **ALONE.get(name, {})}
    return every[builder](system_of(name))


def public_builders():
    """Names of the public functions of a System that say they give a Function."""
    names = set()
    for module, prefix in (
        (models, ""),
        (loops, ""),
        (identification, ""),
        (inverse_geometry, "inverse_geometry."),
    ):
        for name in module.__all__:
            entry = getattr(module, name)
            if inspect.isfunction(entry) and entry.__name__ == name and name != "aba":
                signature = inspect.signature(entry)
                gives = str(signature.return_annotation).strip("'")
                if "system" in signature.parameters and gives in ("Function", "Regressor"):
                    names.add(prefix + name)
    return names


def point(system, f, seed=7):
    """Arguments at which a model is finite: a closed configuration, small numbers elsewhere."""
    rng = np.random.default_rng(seed)
    values = {name: rng.uniform(-1, 1, f.size_in(name)) for name in f.name_in()}
    q = (random_state(system, rng)[0] if not system.is_closed else np.array(system.configuration))[
        :, None
    ]
    fixed = {
        "q": q,
        "p": np.array(system.p_default).reshape(-1, 1),
        "R_0": np.eye(3),
        "x": np.vstack([q, np.zeros((max(0, _rows(f, "x") - len(q)), 1))])[: _rows(f, "x")],
        "q_a": q[list(system.independent)] if len(q) == system.nv else q,
    }
    values |= {name: value for name, value in fixed.items() if name in values}
    if "T" in values:
        values["T"] = np.array(models.direct_geometry(system)(rng.uniform(0.2, 0.9, len(q))))
    if "branch" in values:
        values["branch"] = np.ones(f.size_in("branch"))
    return [values[name] for name in f.name_in()]


def _rows(f, name):
    return f.size1_in(name) if name in f.name_in() else 0


def numbers(results):
    every = results if isinstance(results, (tuple, list)) else (results,)
    return [np.array(casadi.DM(result)) for result in every]


def same(found, expected, tolerance=1e-12):
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=tolerance * max(1, np.abs(b).max(initial=0)))
