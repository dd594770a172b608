"""The symbols of a model, what acts from outside, and the devices that drive shafts."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import ConfigurationCheck, Named, model_function, require_system
from mbs.errors import ModelError
from mbs.loops.accuracy import DIFFERENTIABLE
from mbs.loops.balance import require_no_balance
from mbs.loops.examine import DETERMINED
from mbs.loops.reduction import Reduction, reduction
from mbs.recursions.composite_body import velocity_antecedents
from mbs.recursions.force_elements import element_wrenches, sum_wrenches
from mbs.recursions.parts import PartsAt, later_signal, later_sources
from mbs.recursions.poses import LinkPose, link_poses
from mbs.recursions.velocities import Acceleration, moving_base, resting_base
from mbs.spatial import Wrench, transform_wrench

COORDINATES = ("independent", "tree")


@dataclass(frozen=True, slots=True, eq=False)
class ModelSymbols:
    """Positions and velocities of a system, and how the tree follows the independent joints.

    Attributes:
        q: (nq, 1) positions of the tree; they close the loops.
        v: (m, 1) velocities that are the model's input.
        v_tree: (nv, 1) velocities of the tree that follow.
        suffix: "_a" where the inputs are the independent ones of a closed system.
        reduction: None in tree coordinates.
        poses: of every link with respect to its antecedent.
    """

    q: SX
    v: SX
    v_tree: SX
    suffix: str
    reduction: Reduction | None
    poses: list[LinkPose]

    @property
    def size(self) -> int:
        """Number of velocities that are input."""
        return int(self.v.numel())

    def tree_acceleration(self, a: SX) -> SX:
        """(nv, 1) accelerations of the tree for the accelerations a of the input coordinates."""
        if self.reduction is None:
            return a
        assert self.reduction.gamma is not None
        return casadi.mtimes(self.reduction.G, a) + self.reduction.gamma

    def reduced_effort(self, tau: SX) -> SX:
        """Efforts of the tree brought to the input coordinates: G' tau."""
        return tau if self.reduction is None else casadi.mtimes(self.reduction.G.T, tau)

    def reduced_matrix(self, A: SX) -> SX:
        """G' A G."""
        if self.reduction is None:
            return A
        G = self.reduction.G
        return casadi.mtimes(G.T, casadi.mtimes(A, G))

    def input(self, name: str) -> tuple[str, SX]:
        """An input in the same coordinates as the velocities, such as ("a_a", symbol)."""
        label = name + self.suffix
        return label, SX.sym(label, self.size)


def configuration_check(system: System, coordinates: str) -> ConfigurationCheck | None:
    """What refuses the configurations that a model in these coordinates cannot take.

    Those of a reduced model close the loops, and its independent joints lead the others there.
    """
    require_system(system)
    return DETERMINED if is_reduced(system, coordinates) else None


def derivatives_check(system: System, coordinates: str) -> ConfigurationCheck | None:
    """The same for models that contain second derivatives of the loops."""
    require_system(system)
    return DIFFERENTIABLE if is_reduced(system, coordinates) else None


def check_coordinates(system: System, coordinates: str) -> None:
    """Refuse a word that names no coordinates.

    Raises:
        ModelError: says which words there are.
    """
    if coordinates not in COORDINATES:
        raise ModelError(
            f"{system.name}: coordinates is {coordinates!r}; use 'independent' or 'tree'"
        )


def is_reduced(system: System, coordinates: str) -> bool:
    """Whether these are the coordinates of the independent joints of a closed system."""
    return system.is_closed and coordinates == "independent"


def symbols_of(system: System, coordinates: str = "independent") -> ModelSymbols:
    """Fresh symbols of a system.

    Args:
        system: any.
        coordinates: "independent" or "tree"; they are the same in an open chain.

    Raises:
        ModelError: another word was given.
    """
    check_coordinates(system, coordinates)
    q = SX.sym("q", system.nq)
    poses = link_poses(system.tree, q)
    if not is_reduced(system, coordinates):
        v = SX.sym("v", system.nv)
        return ModelSymbols(q, v, v, "", None, poses)
    v = SX.sym("v_a", len(system.active))
    reduced = reduction(system, q, v)
    # dense: joints of a sub-loop that cannot move have structural zeros in G, and `substitute`
    # takes vectors of one pattern only
    v_tree = reduced.velocities(v)
    return ModelSymbols(q, v, v_tree, "_a", reduced, poses)


def solution_order(system: System, s: ModelSymbols) -> list[int]:
    """For each velocity that is input, the one before it in A; see `factorized`."""
    if s.reduction is None:
        return velocity_antecedents(system.tree)
    return list(range(-1, s.size - 1))


# What acts on a mechanism from outside: gravity, a base that moves, wrenches on bodies.


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """What acts on a mechanism.

    Attributes:
        base: its motion, gravity included.
        external: for some links the wrench that they exert on their environment, about and in
            their frames.
        inputs: of the model, that say all this.
    """

    base: Acceleration
    external: dict[int, Wrench]
    inputs: Named


def surroundings(system: System, f_ext: bool = False, moves: bool = False) -> Surroundings:
    """A resting base under gravity and no wrenches, or inputs for them.

    Args:
        system: whose tree has gravity, given in the base frame at R_0 = 1.
        f_ext: add the input f_ext (6, bodies): for each row of `system.bodies` the wrench [force;
            moment] that the body exerts on its environment, in the body's frame.
        moves: add the inputs v_0 and a_0, (6, 1), velocity [V; w] and acceleration [vd; wd] of
            the base's origin in its own axes, and R_0, (3, 3), orientation of the base frame in
            the fixed frame in which gravity is given.
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
    return Surroundings(base, external, inputs)


def exerted(
    system: System, around: Surroundings, poses: list[LinkPose], q: SX, v: SX
) -> dict[int, Wrench]:
    """For some links the wrench that they exert on their environment, force elements included.

    Args:
        system: whose force elements act.
        around: what else acts.
        poses: of every link with respect to its antecedent.
        q: (nq, 1) positions.
        v: (nv, 1) velocities of the tree.
    """
    return sum_wrenches(around.external, element_wrenches(PartsAt(system, q, v)))


def wrenches_on_links(system: System, wrenches: SX) -> dict[int, Wrench]:
    """The wrenches of bodies, (6, bodies) in their frames, brought to the frames of their links."""
    exerted: list[dict[int, Wrench]] = []
    for column, row in enumerate(system.bodies):
        link, pose = system.frames[row.name]
        exerted.append(
            {link: transform_wrench(pose, (wrenches[0:3, column], wrenches[3:6, column]))}
        )
    return sum_wrenches(*exerted)


# Functions made of other models, on the same symbols.


def outputs_of(system: System, model: Function, *values: SX) -> list[SX]:
    """The outputs of a model on symbols, those of states, inputs and parameters passed on."""
    own = {"z": system.z, "u": system.u, "p": system.p}
    arguments = [*values, *(own[name] for name in model.name_in()[len(values) :])]
    return [SX(output) for output in model.call(arguments)]


def dense_function(name: str, inputs: list[SX], outputs: list[SX]) -> Function:
    """A Function without structural zeros in its outputs, common parts shared."""
    return Function(name, inputs, [casadi.densify(o) for o in outputs], {"cse": True})


# The drives of shafts, and all states and outputs of parts.


def devices(system: System) -> Function:
    """``devices(v, z, u) -> tau, zdot, y``: motors and torques, states and outputs of components.

    The elements of z, u and y are those that `devices(system).elements("z")` names: states such as
    currents; inputs such as voltages and torques; what a simulation shows beside them; of all
    components that have some.

    Args:
        system: open or closed, with devices or components that have states or outputs.

    Returns:
        Function of v (nv, 1) velocities of the tree, z (nz, 1) states and u (nu, 1) inputs, and of
        q (nq, 1) before them where something depends on positions, and of row_efforts (r, 1) after
        them where an output tells the efforts of rows of components, all of them in the order
        of the components; tau (nv, 1) what drives deliver at the coordinates [N m or N],
        zdot (nz, 1), y (ny, 1).

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
        inputs = [("v", v), ("z", system.z), ("u", system.u)]
        if casadi.depends_on(every, q):
            inputs.insert(0, ("q", q))
        if casadi.depends_on(every, parts.effort_symbols):
            inputs.append(("row_efforts", parts.effort_symbols))
        return inputs, [("tau", tau), ("zdot", zdot), ("y", y)]

    return model_function(system, ("devices",), build)


def state_count(system: System) -> int:
    """Number of the states of all parts."""
    return int(system.z.numel())


def part_equations(system: System, q: SX, v: SX) -> tuple[SX, SX, PartsAt]:
    """What drives deliver at the coordinates, the rates of all states, and the parts themselves.

    They are of the symbols `system.z`, `system.u` and `system.p` besides.

    Args:
        system: with parts or without any.
        q: (nq, 1) positions.
        v: (nv, 1) velocities of the tree.
    """
    at = PartsAt(system, q, v)
    return at.delivered(), at.rates(), at
