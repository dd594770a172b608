"""Symbols of models, external loads on a mechanism, and equations of components and devices."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import ConfigurationCheck, Named, model_function, require_system
from mbs.errors import ModelError
from mbs.loops.accuracy import DIFFERENTIABLE
from mbs.loops.balance import require_no_balance
from mbs.loops.examination import DETERMINED
from mbs.loops.reduction import Reduction, reduction
from mbs.recursions.composite_body import velocity_antecedents
from mbs.recursions.force_elements import element_wrenches, sum_wrenches
from mbs.recursions.link_motions import (
    Acceleration,
    LinkPose,
    link_poses,
    moving_base,
    resting_base,
)
from mbs.recursions.parts import PartsAt, later_signal, later_sources
from mbs.spatial import Wrench, transform_wrench

COORDINATES = ("independent", "tree")


@dataclass(frozen=True, slots=True, eq=False)
class ModelSymbols:
    """Symbols q and v of a model, with the tree velocities and link poses as expressions in them.

    Attributes:
        q: (nq, 1) positions of the tree; they must close the loops.
        v: (m, 1) input velocities of the model.
        v_tree: (nv, 1) velocities of the tree.
        suffix: "_a" if v are the independent velocities of a closed system, else "".
        reduction: v_tree = G v and its derivative; None in tree coordinates.
        poses: pose of each link relative to its antecedent.
    """

    q: SX
    v: SX
    v_tree: SX
    suffix: str
    reduction: Reduction | None
    poses: list[LinkPose]

    @property
    def size(self) -> int:
        """Number m of input velocities."""
        return int(self.v.numel())

    def tree_acceleration(self, a: SX) -> SX:
        """Return the accelerations (nv, 1) of the tree for accelerations a (m, 1): G a + gamma."""
        if self.reduction is None:
            return a
        assert self.reduction.gamma is not None
        return casadi.mtimes(self.reduction.G, a) + self.reduction.gamma

    def reduced_effort(self, tau: SX) -> SX:
        """Return joint efforts tau (nv, 1) of the tree in input coordinates: G' tau, (m, 1)."""
        return tau if self.reduction is None else casadi.mtimes(self.reduction.G.T, tau)

    def reduced_matrix(self, A: SX) -> SX:
        """Return a matrix A (nv, nv) of the tree in input coordinates: G' A G, (m, m)."""
        if self.reduction is None:
            return A
        G = self.reduction.G
        return casadi.mtimes(G.T, casadi.mtimes(A, G))

    def input(self, name: str) -> tuple[str, SX]:
        """Return name and new symbol (m, 1) of an input in the coordinates of v.

        Args:
            name: name without suffix: "a" gives ("a_a", symbol) in independent coordinates.
        """
        label = name + self.suffix
        return label, SX.sym(label, self.size)


def configuration_check(system: System, coordinates: str) -> ConfigurationCheck | None:
    """Return the check of configurations for a model in some coordinates; None if not needed.

    A model in independent coordinates requires closed loops and dependent joints that are
    determined by the independent joints.

    Args:
        system: open or closed mechanism.
        coordinates: "independent" or "tree".

    Raises:
        ModelError: `system` is not a System.
    """
    require_system(system)
    return DETERMINED if is_reduced(system, coordinates) else None


def derivatives_check(system: System, coordinates: str) -> ConfigurationCheck | None:
    """Return the check of configurations for models that contain second derivatives of loops.

    It is stricter than `configuration_check`; None if not needed.

    Args:
        system: open or closed mechanism.
        coordinates: "independent" or "tree".
    """
    require_system(system)
    return DIFFERENTIABLE if is_reduced(system, coordinates) else None


def check_coordinates(system: System, coordinates: str) -> None:
    """Raise ModelError if `coordinates` is not "independent" or "tree".

    Args:
        system: mechanism, for the message.
        coordinates: argument of a user.
    """
    if coordinates not in COORDINATES:
        raise ModelError(
            f"{system.name}: coordinates is {coordinates!r}; use 'independent' or 'tree'"
        )


def is_reduced(system: System, coordinates: str) -> bool:
    """Return whether a model is in the independent coordinates of a closed system.

    Args:
        system: open or closed mechanism.
        coordinates: "independent" or "tree".
    """
    return system.is_closed and coordinates == "independent"


def symbols_of(system: System, coordinates: str = "independent") -> ModelSymbols:
    """Return new symbols q and v of a system, with velocities and poses of the tree.

    Args:
        system: open or closed mechanism.
        coordinates: "independent" or "tree"; they are equivalent for an open chain.

    Raises:
        ModelError: `coordinates` is another word.
    """
    check_coordinates(system, coordinates)
    q = SX.sym("q", system.nq)
    poses = link_poses(system.tree, q)
    if not is_reduced(system, coordinates):
        v = SX.sym("v", system.nv)
        return ModelSymbols(q, v, v, "", None, poses)
    v = SX.sym("v_a", len(system.independent))
    reduced = reduction(system, q, v)
    # v_tree is dense: immobile joints of a sub-loop have structural zeros in G, but `substitute`
    # requires equal sparsity patterns
    v_tree = reduced.velocities(v)
    return ModelSymbols(q, v, v_tree, "_a", reduced, poses)


def solution_order(system: System, s: ModelSymbols) -> list[int]:
    """Return the parent of each input velocity for the sparse factorisation of A.

    It is -1 for a velocity without a parent. In independent coordinates A is dense, so that the
    parent is the preceding index. See `factorize`.

    Args:
        system: open or closed mechanism.
        s: symbols of the model.
    """
    if s.reduction is None:
        return velocity_antecedents(system.tree)
    return list(range(-1, s.size - 1))


# External loads on a mechanism: gravity, a moving base, wrenches on bodies.


@dataclass(frozen=True, slots=True, eq=False)
class ExternalForces:
    """Base motion and external wrenches of a mechanism.

    Attributes:
        base: motion of the base; its acceleration includes minus gravity.
        external: dict from link index to the wrench that the link exerts on the environment, about
            and in the link frame.
        inputs: named model inputs that `base` and `external` depend on.
    """

    base: Acceleration
    external: dict[int, Wrench]
    inputs: Named


def surroundings(system: System, f_ext: bool = False, moves: bool = False) -> ExternalForces:
    """Return gravity and base motion of a mechanism, and external wrenches, as model inputs.

    By default the base rests and there are no external wrenches.

    Args:
        system: mechanism; its gravity vector is expressed in the base frame at R_0 = 1.
        f_ext: whether to add the input f_ext (6, bodies): for each row of `system.bodies` the
            wrench [force; moment] that the body exerts on its environment, in the body frame.
        moves: whether to add the inputs v_0 and a_0 (6, 1), velocity [V; w] and acceleration [vd;
            wd] of the base origin in base axes, and R_0 (3, 3), orientation of the base in the
            fixed frame that gravity is expressed in.
    """
    gravity, inputs = system.tree.gravity, list[tuple[str, SX]]()
    base, external = resting_base(gravity), dict[int, Wrench]()
    if f_ext:
        require_no_balance(system, "f_ext", velocities=range(system.nv))
        wrenches = SX.sym("f_ext", 6, len(system.bodies))
        external = wrenches_on_links(system, wrenches)
        inputs.append(("f_ext", wrenches))
    if moves:
        v_0, a_0, R_0 = SX.sym("v_0", 6), SX.sym("a_0", 6), SX.sym("R_0", 3, 3)
        base = moving_base(v_0[3:6], a_0[3:6], a_0[0:3] - casadi.mtimes(R_0.T, gravity))
        inputs += [("v_0", v_0), ("a_0", a_0), ("R_0", R_0)]
    return ExternalForces(base, external, inputs)


def exerted(
    system: System, around: ExternalForces, poses: list[LinkPose], q: SX, v: SX
) -> dict[int, Wrench]:
    """Return the wrenches that links exert on environment and force elements, by link index.

    They are about the origin and in axes of the link frame.

    Args:
        system: mechanism with force elements.
        around: base motion and external wrenches.
        poses: pose of each link relative to its antecedent.
        q: (nq, 1) positions.
        v: (nv, 1) velocities of the tree.
    """
    return sum_wrenches(around.external, element_wrenches(PartsAt(system, q, v)))


def wrenches_on_links(system: System, wrenches: SX) -> dict[int, Wrench]:
    """Return wrenches on bodies as wrenches on links, by link index.

    Args:
        system: open or closed mechanism.
        wrenches: (6, bodies) wrench of each row of `system.bodies`, in the body frame.

    Returns:
        sums about the origin and in axes of the link frames.
    """
    exerted: list[dict[int, Wrench]] = []
    for column, row in enumerate(system.bodies):
        link, pose = system.frames[row.name]
        exerted.append(
            {link: transform_wrench(pose, (wrenches[0:3, column], wrenches[3:6, column]))}
        )
    return sum_wrenches(*exerted)


# Calls of a model on symbols of another model.


def outputs_of(system: System, model: Function, *values: SX) -> list[SX]:
    """Return the outputs of a model for SX values of its inputs.

    Args:
        system: mechanism; its symbols z, u and p are passed as the remaining inputs.
        model: Function of a model.
        values: first inputs of the model, such as q, v and tau.
    """
    own = {"z": system.component_states, "u": system.u, "p": system.p}
    arguments = [*values, *(own[name] for name in model.name_in()[len(values) :])]
    return [SX(output) for output in model.call(arguments)]


def dense_function(name: str, inputs: list[SX], outputs: list[SX]) -> Function:
    """Return a Function with dense outputs and common subexpression elimination.

    Args:
        name: name of the Function.
        inputs: symbols.
        outputs: expressions.
    """
    return Function(name, inputs, [casadi.densify(o) for o in outputs], {"cse": True})


# Devices that drive shafts, and the states and outputs of all components.


def devices(system: System) -> Function:
    """Return the equations of devices and other components: ``devices(v, z, u) -> tau, zdot, y``.

    z are component states such as currents, u component inputs such as voltages and torques, y
    further component outputs of a simulation. `devices(system).elements("z")` names the elements.

    Args:
        system: open or closed, with devices or with components that have states or outputs.

    Returns:
        Function of tree velocities v (nv, 1), states z (nz, 1) and inputs u (nu, 1). The first
        input is q (nq, 1) if an output depends on positions. The last input is row_efforts (r, 1),
        efforts of the constraint rows of components in their order, if an output depends on them.
        Outputs: efforts tau (nv, 1) of devices on the joint coordinates [N m or N], zdot (nz, 1), y
        (ny, 1).

    Raises:
        ModelError: the system has no device, state or output.
    """
    require_system(system)
    if not (system.devices or system.states or system.outputs):
        raise ModelError(
            f"{system.name}: there is no motor and no torque on a flange, and no component with"
            " states or outputs; connect a DCMotor or a TorqueSource, or use the efforts tau of the"
            " joints"
        )

    def build() -> tuple[Named, Named]:
        q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
        tau, zdot, parts = part_equations(system, q, v)
        y = parts.outputs()
        every = casadi.vertcat(tau, zdot, y)
        for source in later_sources(system):
            if casadi.depends_on(every, later_signal(system, source)):
                raise ModelError(
                    f"{system.name}: the rate of a state follows from {source}, which this model"
                    " does not know; use mbs.models.dae or mbs.simulate.run"
                )
        inputs = [("v", v), ("z", system.component_states), ("u", system.u)]
        if casadi.depends_on(every, q):
            inputs.insert(0, ("q", q))
        if casadi.depends_on(every, parts.effort_symbols):
            inputs.append(("row_efforts", parts.effort_symbols))
        return inputs, [("tau", tau), ("zdot", zdot), ("y", y)]

    return model_function(system, ("devices",), build)


def state_count(system: System) -> int:
    """Return the number of states of all components.

    Args:
        system: open or closed mechanism.
    """
    return int(system.component_states.numel())


def part_equations(system: System, q: SX, v: SX) -> tuple[SX, SX, PartsAt]:
    """Return efforts of devices (nv, 1), rates of component states, and the components.

    The last are the `PartsAt` at q and v.

    The expressions also depend on the symbols `system.component_states`, `system.u` and `system.p`.

    Args:
        system: mechanism with or without components.
        q: (nq, 1) positions.
        v: (nv, 1) velocities of the tree.
    """
    at = PartsAt(system, q, v)
    return at.delivered(), at.rates(), at
