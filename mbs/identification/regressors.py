"""Identification models: efforts, momenta and energy as matrices times the dynamic parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypedDict, Unpack

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import ModelFunction, Named, model_function, require_system
from mbs.assembly.tree import CarriedRotor, Link, Tree, position_rate
from mbs.components.joints import Motion
from mbs.errors import ModelError
from mbs.models.symbols import (
    ModelSymbols,
    check_coordinates,
    configuration_check,
    surroundings,
    symbols_of,
)
from mbs.recursions.force_elements import element_efforts
from mbs.recursions.link_motions import (
    Acceleration,
    LinkPose,
    Velocity,
    link_accelerations,
    link_velocities,
)
from mbs.recursions.newton_euler import (
    rotor_and_friction,
    rotor_efforts,
    rotor_moments,
    spring_effort,
)
from mbs.recursions.parts import PartsAt
from mbs.recursions.regressor import (
    PathTwist,
    inertial_energy,
    inertial_regressor,
    momentum_regressor,
    path_twist_rates,
    path_twists,
    position_regressor,
    work,
)
from mbs.spatial import zeros
from mbs.text import did_you_mean, quoted

# Parameters in which the equations of motion are linear: names, units and present values.


INERTIAL = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
"""Kinds of the ten inertial parameters of a link, about the origin of its frame and in its axes."""

COUPLED = ("Iam", "Fvm", "Fsm")
"""Kinds of the parameters of a motor that is coupled to two joints: inertia, viscous and
Coulomb friction."""

_INERTIAL_UNITS = ("kg.m2",) * 6 + ("kg.m",) * 3 + ("kg",)
_REVOLUTE_UNITS = {
    **{kind: "kg.m2" for kind in ("Ia", "Iam", "Jm")},
    **{kind: "N.m.s/rad" for kind in ("Fv", "Fvm")},
    **{kind: "N.m" for kind in ("Fs", "Fsm", "offset")},
}
_PRISMATIC_UNITS = {
    **{kind: "kg" for kind in ("Ia", "Iam")},
    **{kind: "N.s/m" for kind in ("Fv", "Fvm")},
    **{kind: "N" for kind in ("Fs", "Fsm", "offset")},
    "Jm": "kg.m2",
}

_LAW = "law "

Joints = tuple[str | int, str | int]
"""Two joints of the tree, by name or by link number (from 1)."""


class ColumnChoice(TypedDict, total=False):
    """Options that select the columns; see `columns_of`."""

    rotors: bool
    friction: bool
    offsets: bool
    couplings: Sequence[Joints]
    laws: Sequence[str]


@dataclass(frozen=True, slots=True)
class Column:
    """Parameter in which the equations of motion are linear: one column of a regressor.

    Attributes:
        name: kind and link number, such as "XX3".
        kind: XX XY XZ YY YZ ZZ MX MY MZ M of the link; Ia, Fv, Fs or offset of its joint; Jm, the
            inertia of a rotor that is driven by the joint; Iam, Fvm or Fsm of a motor that is
            coupled to two joints; "law k" for the symbol k of force elements and other components.
        link: link number, from 1; 0 for a symbol of components.
        unit: unit of the parameter.
        other: link number of the second joint of a coupled motor, otherwise 0.
    """

    name: str
    kind: str
    link: int
    unit: str
    other: int = 0

    @property
    def key(self) -> tuple[str, int, int]:
        """Identity of the parameter, independent of its name: (kind, link, other)."""
        return self.kind, self.link, self.other

    @property
    def symbol(self) -> str:
        """Name of the component symbol that is the parameter; empty for other parameters."""
        return self.kind.removeprefix(_LAW) if self.kind.startswith(_LAW) else ""


def columns_of(
    system: System,
    *,
    rotors: bool = True,
    friction: bool = True,
    offsets: bool = False,
    couplings: Sequence[Joints] = (),
    laws: Sequence[str] = (),
) -> tuple[Column, ...]:
    """Return the parameters of a system, link by link, then coupled motors and component laws.

    A link always has its ten inertial parameters, including those of value zero. Passive joints
    have Ia, and free joints have Ia and friction, only if the system defines nonzero values for
    them.

    Source: Khalil & Creusot 1997, section 2.2; Gautier, Janot & Vandanjon 2013 for coupled motors.

    Args:
        system: open or closed.
        rotors: whether to include Ia of actuated joints, and Jm of rotors that are driven by
            joints.
        friction: whether to include Fv and Fs of every joint.
        offsets: whether to include a constant effort of every joint of one degree of freedom.
        couplings: pairs of joints, one for each coupled motor: the joint of the motor and the
            second joint. The motor velocity is the sum of the two joint velocities.
        laws: symbols of the system in which force elements and other components are linear, such as
            the stiffness of a spring.

    Raises:
        ModelError: `system` is not a System, a law is not such a symbol, or a coupling does not
            name two joints of one degree of freedom that are both revolute or both prismatic.
    """
    require_system(system)
    columns: list[Column] = []
    for number, link in enumerate(system.tree.links, start=1):
        kinds = [
            *(_rotor_kinds(system, link) if rotors else ()),
            *(_friction_kinds(link) if friction else ()),
            *(("offset",) if offsets and link.motion.nv == 1 else ()),
        ]
        columns += _inertial_columns(number)
        columns += [Column(f"{kind}{number}", kind, number, _unit(link, kind)) for kind in kinds]
    for pair in couplings:
        columns += _coupled_motor_columns(system, pair)
    columns += [_law_column(system, name, laws) for name in laws]
    return tuple(columns)


def _law_column(system: System, name: str, laws: Sequence[str]) -> Column:
    """Return the regressor column of the component symbol `name`.

    `laws` are all symbols that have columns.

    Raises:
        ModelError: there is no such symbol, it also appears outside the component laws, or the
            efforts are not linear in the symbols of `laws`.
    """
    symbols = system.symbol_table
    if name not in symbols:
        raise ModelError(
            f"{system.name}: laws names {quoted(name)}; {did_you_mean(str(name), symbols)}"
        )
    s, symbol = symbols_of(system, "tree"), symbols[name]
    acting = element_efforts(PartsAt(system, s.q, s.v_tree), s.poses)
    slopes = casadi.jacobian(acting, symbol)
    elsewhere = [
        *symbolic_parameters(system, columns_of(system)).nz,
        *spring_effort(system.tree, s.q).nz,
    ]
    placed = [frame.parameters for link in system.tree.links for frame in link.frames]
    others = casadi.veccat(*elsewhere, *(x for row in placed for x in row), system.tree.gravity)
    if not casadi.depends_on(acting, symbol) or casadi.depends_on(others, symbol):
        raise ModelError(
            f"{system.name}: laws names {name!r}, which is not a symbol of force elements or other"
            " components alone; name one that stands in their laws only"
        )
    for other in laws:
        if other in symbols and casadi.depends_on(slopes, symbols[other]):
            both = f"{name!r}" if other == name else f"{name!r} and {other!r} together"
            raise ModelError(
                f"{system.name}: the efforts are not linear in {both}; name symbols in which they"
                " are, such as a stiffness"
            )
    unit = next(p.unit for p in system.parameters if p.name == name)
    return Column(name, f"{_LAW}{name}", 0, unit)


@dataclass(frozen=True, slots=True, eq=False)
class LawColumns:
    """Regressor columns of the symbols in which force elements and other components are linear.

    Attributes:
        system: system of the components.
        s: symbols of positions and velocities of the system.
    """

    system: System
    s: ModelSymbols

    def effort(self, column: Column) -> SX:
        """Return the tree efforts (nv, 1) per unit of the component symbol of the column."""
        acting = element_efforts(PartsAt(self.system, self.s.q, self.s.v_tree), self.s.poses)
        return casadi.densify(casadi.jacobian(acting, self.system.symbol_table[column.symbol]))

    def energy(self, column: Column) -> SX:
        """Return the energy that the components store per unit of the symbol of the column.

        Raises:
            ModelError: the stored energy is not linear in the symbol.
        """
        stored, symbol = PartsAt(self.system, self.s.q).energy(), column.symbol
        slope = casadi.jacobian(stored, self.system.symbol_table[symbol])
        if casadi.depends_on(slope, self.system.symbol_table[symbol]):
            raise ModelError(
                f"{self.system.name}: what components store is not linear in {symbol!r}, as the"
                " energy model needs; use regressor or filtered_regressor, or name other symbols"
            )
        return SX(slope)

    def power(self, column: Column) -> SX:
        """Return the power that the components dissipate per unit of the symbol of the column.

        It is the power absorbed minus the rate of the stored energy.
        """
        rate = position_rate(self.system.tree, self.s.q, self.s.v_tree)
        stored = casadi.jtimes(self.energy(column), self.s.q, rate)
        return SX(casadi.dot(self.s.v_tree, self.effort(column)) - stored)


def chosen_columns(
    system: System, columns: Sequence[Column] | None, choice: ColumnChoice
) -> tuple[Column, ...]:
    """Return the given columns after a check, or the columns of `columns_of`.

    Args:
        system: open or closed.
        columns: parameters in the requested order, with any names; None to select them by `choice`.
        choice: options of `columns_of`.

    Raises:
        ModelError: both columns and options are given, or a column is not a parameter of the system
            or occurs twice.
    """
    if columns is None:
        return columns_of(system, **choice)
    require_system(system)
    if choice:
        raise ModelError(
            f"{system.name}: columns were given and {quoted(next(iter(choice)))} too; give the"
            " columns alone"
        )
    require_columns(system, columns)
    column_indices(system, every_column(system, columns), columns)
    if len({column.key for column in columns}) < len(columns):
        twice = next(c for k, c in enumerate(columns) if c.key in {b.key for b in columns[:k]})
        raise ModelError(f"{system.name}: {quoted(twice.name)} is given twice; give it once")
    return tuple(columns)


def require_columns(system: System, columns: Sequence[Column]) -> None:
    """Raise unless all elements are Column objects.

    Args:
        system: system that is named in the message.
        columns: elements to check.

    Raises:
        ModelError: an element is not a Column; the message quotes it.
    """
    rows = columns if isinstance(columns, list | tuple) else [columns]
    wrong = [row for row in rows if not isinstance(row, Column)]
    if wrong:
        raise ModelError(
            f"{system.name}: columns holds {quoted(wrong[0])}, which is no Column; give those of"
            " columns_of(system), or .kept of base parameters"
        )


def every_column(system: System, columns: Sequence[Column]) -> tuple[Column, ...]:
    """Return all system parameters of the kinds in `columns`, in the order of `columns_of`.

    Args:
        system: open or closed.
        columns: parameters that select whether offsets, coupled motors and component symbols are
            included.
    """
    return columns_of(
        system,
        offsets=any(column.kind == "offset" for column in columns),
        couplings=list(dict.fromkeys((c.link, c.other) for c in columns if c.other)),
        laws=list(dict.fromkeys(c.symbol for c in columns if c.symbol)),
    )


def column_indices(system: System, every: Sequence[Column], columns: Sequence[Column]) -> list[int]:
    """Return the indices in `every` of the parameters `columns`, which may have other names.

    Args:
        system: system that is named in the message.
        every: all parameters.
        columns: parameters to find.

    Raises:
        ModelError: a column is not in `every`.
    """
    indices = {column.key: k for k, column in enumerate(every)}
    for column in columns:
        if column.key not in indices:
            known = did_you_mean(column.name, [c.name for c in every])
            raise ModelError(
                f"{system.name}: {quoted(column.name)} is no parameter of the system; {known}"
            )
    return [indices[column.key] for column in columns]


def symbolic_parameters(system: System, columns: Iterable[Column]) -> SX:
    """Return the values (n, 1) of the dynamic parameters of a system: numbers or expressions.

    Offsets and the parameters of coupled motors are zero, since a system does not contain them.

    Args:
        system: open or closed; expressions contain its symbols.
        columns: the n parameters.
    """
    links = system.tree.links
    ten = [link.inertia.parameters for link in links]
    values = []
    for column in columns:
        if column.symbol:
            values.append(system.symbol_table[column.symbol])
            continue
        link = links[column.link - 1]
        if column.kind in INERTIAL:
            values.append(ten[column.link - 1][INERTIAL.index(column.kind)])
        else:
            values.append(_joint_value(link, column.kind))
    return casadi.densify(casadi.vertcat(SX(0, 1), *values))


def numeric_parameters(
    system: System, columns: Iterable[Column], values: Mapping[str, float] | None = None
) -> NDArray[np.float64]:
    """Return the values (n,) of the dynamic parameters of a system as numbers.

    Args:
        system: open or closed.
        columns: the n parameters.
        values: values of symbols by name. Other symbols have their default values.

    Raises:
        ModelError: a symbol has no value, or the system has no symbol of that name.
    """
    K = Function("K", [system.p], [symbolic_parameters(system, columns)])
    return np.asarray(K(DM(system.parameter_values(values))), dtype=float).ravel()


def _joint_value(link: Link, kind: str) -> SX:
    """Return value of the joint parameter `kind` of a link: "Ia", "Jm", "Fv" or "Fs"; else 0."""
    if kind == "Jm":
        return link.rotor.inertia if link.rotor is not None else SX(0)
    known = {"Ia": link.Ia, "Fv": link.Fv, "Fs": link.Fs}
    return known.get(kind, SX(0))


def _inertial_columns(number: int) -> list[Column]:
    """Return the columns of the ten inertial parameters of the link with this number (from 1)."""
    pairs = zip(INERTIAL, _INERTIAL_UNITS, strict=True)
    return [Column(f"{kind}{number}", kind, number, unit) for kind, unit in pairs]


def _rotor_kinds(system: System, link: Link) -> list[str]:
    """Return the kinds of rotor inertia of a joint that have columns: "Ia", "Jm", both or none.

    "Ia" is included if it is nonzero or the joint is actuated without an own rotor.
    """
    driven = system.velocity_coordinates[link.v.start].actuated and link.rotor is None
    kinds = ["Ia"] if driven or not link.Ia.is_zero() else []
    return [*kinds, "Jm"] if link.rotor is not None else kinds


def _friction_kinds(link: Link) -> list[str]:
    """Return the kinds of friction of a joint that have columns: "Fv" and "Fs".

    A free joint has only those that are nonzero.
    """
    given = {"Fv": link.Fv, "Fs": link.Fs}
    return [k for k, x in given.items() if link.motion is not Motion.FREE or not x.is_zero()]


def _unit(link: Link, kind: str) -> str:
    """Return the unit of a joint parameter of this kind, which depends on the type of the joint."""
    return (_PRISMATIC_UNITS if link.motion is Motion.PRISMATIC else _REVOLUTE_UNITS)[kind]


def _coupled_motor_columns(system: System, pair: Joints) -> list[Column]:
    """Return the columns Iam, Fvm, Fsm of a motor that is coupled to the two joints of `pair`.

    Raises ModelError unless they are two joints of the same type.
    """
    if not isinstance(pair, (tuple, list)) or len(pair) != 2:
        raise ModelError(
            f"{system.name}: the coupling {quoted(pair)} does not name two joints; give a pair such"
            " as ('j6', 'j5')"
        )
    number, other = (_joint_number(system, name) for name in pair)
    link, second = (system.tree.links[k - 1] for k in (number, other))
    if number == other or link.motion is not second.motion:
        raise ModelError(
            f"{system.name}: the coupling {quoted(tuple(pair))} joins {link.name!r}"
            f" ({link.motion.value}) and {second.name!r} ({second.motion.value}); name two joints"
            " that are both revolute or both prismatic"
        )
    return [Column(f"{k}{number}", k, number, _unit(link, k), other) for k in COUPLED]


def _joint_number(system: System, name: str | int) -> int:
    """Return the link number (from 1) of a joint of one degree of freedom, by name or number.

    Raises ModelError if there is no such joint.
    """
    links = system.tree.links
    names = {link.name: k for k, link in enumerate(links, start=1) if link.motion.nv == 1}
    if isinstance(name, str) and name in names:
        return names[name]
    if isinstance(name, int) and not isinstance(name, bool) and name in names.values():
        return name
    raise ModelError(
        f"{system.name}: the coupling names {quoted(name)}, which is no joint of one degree of"
        f" freedom of the tree; {did_you_mean(name, names)}"
    )


# Contributions of one joint or motor parameter to efforts, momenta and energy.


_INERTIAS = ("Ia", "Iam", "Jm")


@dataclass(frozen=True, slots=True, eq=False)
class JointColumns:
    """Regressor columns of joint, rotor and motor parameters at one state of the tree.

    Attributes:
        tree: the links.
        poses: pose of each link relative to its antecedent.
        v: (nv, 1) joint velocities.
        velocities: velocities of the links.
        base: velocity of the base; None if the base is at rest.
    """

    tree: Tree
    poses: list[LinkPose]
    v: SX
    velocities: list[Velocity]
    base: Velocity | None

    @staticmethod
    def of(tree: Tree, poses: list[LinkPose], v: SX, base: Velocity | None = None) -> JointColumns:
        """Return the columns at joint velocities v, from which the link velocities are computed.

        Args:
            tree: the links.
            poses: pose of each link relative to its antecedent.
            v: (nv, 1) joint velocities [rad/s or m/s].
            base: velocity of the base; None if the base is at rest.
        """
        return JointColumns(tree, poses, v, link_velocities(tree, poses, v, base), base)

    def effort(self, column: Column, a: SX, motions: list[Acceleration], base: Acceleration) -> SX:
        """Return the joint efforts (nv, 1) per unit of a parameter.

        Args:
            column: the parameter.
            a: (nv, 1) joint accelerations.
            motions: accelerations of the links.
            base: acceleration of the base.
        """
        if column.kind != "Jm":
            return self._own_effort(column, self.v, a)
        alone = self._with_one_rotor(column)
        total = rotor_efforts(alone, a, motions, base)
        for c, moment in rotor_moments(alone, self.v, a, motions).items():
            total += self._moment_efforts(self._twists(c), moment)
        return total

    def momentum(self, column: Column) -> SX:
        """Return the generalised momentum (nv, 1) per unit of a parameter.

        It is the derivative of the kinetic energy in the joint velocities.

        Args:
            column: parameter.
        """
        if column.kind not in _INERTIAS:
            return zeros(self.tree.nv)
        if column.kind != "Jm":
            return self._own_effort(column, zeros(self.tree.nv), self.v)
        link, rotor = self._rotor(column)
        total = zeros(self.tree.nv)
        total[link.v] = rotor.seen_at_joint * self.v[link.v] + self._carrier_momentum(rotor)
        if rotor.carrier >= 0:
            spin = rotor.momentum * self.v[link.v]
            total += self._moment_efforts(self._twists(rotor.carrier), spin)
        return total

    def remaining_effort(self, column: Column) -> SX:
        """Return the efforts (nv, 1) apart from the rate of `momentum`, per unit of a parameter.

        These are the joint efforts minus the time derivative of the generalised momentum.

        Args:
            column: parameter.
        """
        if column.kind != "Jm":
            return self._own_effort(column, self.v, zeros(self.tree.nv))
        link, rotor = self._rotor(column)
        if rotor.carrier < 0:
            return zeros(self.tree.nv)
        rates = path_twist_rates(self.tree, self.poses, self.velocities)
        return -self._moment_efforts(rates[rotor.carrier], rotor.momentum * self.v[link.v])

    def energy(self, column: Column) -> SX:
        """Return the kinetic energy per unit of a parameter; zero for friction and offsets.

        Args:
            column: parameter.
        """
        if column.kind not in _INERTIAS:
            return SX(0)
        return SX(0.5 * casadi.dot(self.v, self.momentum(column)))

    def power(self, column: Column) -> SX:
        """Return the power that friction or an offset absorbs per unit of it; zero for inertias.

        Args:
            column: parameter.
        """
        if column.kind in _INERTIAS:
            return SX(0)
        return SX(casadi.dot(self.v, self.remaining_effort(column)))

    def _own_effort(self, column: Column, v: SX, a: SX) -> SX:
        """Return the joint efforts (nv, 1) of a parameter Ia, Fv, Fs or offset of value 1.

        It acts on the joint of its link, or on two joints if their motors are coupled. The effort
        has the sign of inverse dynamics: positive if a motor must overcome it.

        `column` is the parameter; v and a are (nv, 1) joint velocities and accelerations.
        """
        link, total = self.tree.links[column.link - 1], zeros(self.tree.nv)
        if column.kind == "offset":
            total[link.v] = 1
            return total
        one = {column.kind.removesuffix("m"): SX(1)}
        Ia, Fv, Fs = (one.get(kind, SX(0)) for kind in ("Ia", "Fv", "Fs"))
        unit = replace(link, Ia=Ia, Fv=Fv, Fs=Fs)
        if column.kind not in COUPLED:
            total[link.v] = _joint_law(unit, v[link.v], a[link.v])
            return total
        second = self.tree.links[column.other - 1]
        effort = _joint_law(unit, v[link.v] + v[second.v], a[link.v] + a[second.v])
        total[link.v] = total[second.v] = effort
        return total

    def _with_one_rotor(self, column: Column) -> Tree:
        """Return the tree with only the rotor of the column, of unit inertia."""
        links = [
            replace(link, rotor=self._rotor(column)[1] if number == column.link else None)
            for number, link in enumerate(self.tree.links, start=1)
        ]
        return Tree(tuple(links), self.tree.gravity)

    def _rotor(self, column: Column) -> tuple[Link, CarriedRotor]:
        """Return the link of the column and its rotor with unit inertia."""
        link = self.tree.links[column.link - 1]
        assert link.rotor is not None
        return link, replace(link.rotor, inertia=SX(1))

    def _carrier_momentum(self, rotor: CarriedRotor) -> SX:
        """Return the momentum of a rotor at its joint that is due to the rotation of its carrier.

        The carrier is the link that supports the rotor, or the base.
        """
        carrier = self.velocities[rotor.carrier] if rotor.carrier >= 0 else self.base
        return SX(0) if carrier is None else SX(casadi.dot(rotor.momentum, carrier.w))

    def _twists(self, carrier: int) -> list[PathTwist]:
        """Return the twists of the joints on the path from the base to link `carrier` (index)."""
        return path_twists(self.tree, self.poses)[carrier]

    def _moment_efforts(self, twists: list[PathTwist], moment: SX) -> SX:
        """Return the generalised forces (nv, 1) of a moment (3, 1) along the path twists."""
        total = zeros(self.tree.nv)
        for twist in twists:
            total[twist.row] = work(twist, (None, moment))
        return total


def _joint_law(link: Link, v: SX, a: SX) -> SX:
    """Return the efforts (nv, 1) of rotor inertia and friction of the joint of a link.

    `v` and `a` are the velocities and accelerations of this joint.
    """
    alone = replace(link, v=slice(0, link.motion.nv))
    return rotor_and_friction(Tree((alone,), zeros()), v, a)


# Dynamic identification model: joint efforts as a matrix times the dynamic parameters.


class Regressor(ModelFunction):
    """Model whose outputs have one column for each dynamic parameter.

    Attributes:
        columns: parameters, in the order of the columns of every output.
    """

    def __init__(self, model: ModelFunction, columns: tuple[Column, ...]) -> None:
        ModelFunction.__init__(
            self, model, model.system, model._annotate, model._check_configuration
        )
        self.columns = columns

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(column.name for column in self.columns)

    @property
    def effective(self) -> NDArray[np.bool_]:
        """Mask (n,) of the columns that have an element that is not structurally zero."""
        found = np.zeros(len(self.columns), dtype=bool)
        for output in self._outputs():
            pattern = casadi.sparsify(output).sparsity()
            found[np.unique(pattern.get_triplet()[1])] = True
        return found

    def elements(self, name: str) -> list[tuple[str, str]]:
        """Return (name, unit) of the elements of an input, or of the columns of an output."""
        if name in self.name_out():
            return [(column.name, column.unit) for column in self.columns]
        return ModelFunction.elements(self, name)

    def like(self, function: Function) -> ModelFunction:
        """Return another Function as a model with the same inputs.

        It is a Regressor with the same columns if its first output has the same size.

        Args:
            function: Function of the same inputs, such as a derivative or compiled code.
        """
        same = function.size_out(0) == self.size_out(0)
        plain = ModelFunction(function, self.system, None, self._check_configuration)
        return Regressor(plain, self.columns) if same else ModelFunction.like(self, function)

    def _outputs(self) -> list[SX]:
        """Return the outputs as SX expressions of new symbols."""
        inputs = [SX.sym(name, self.sparsity_in(name)) for name in self.name_in()]
        return list(Function.call(self, inputs, True, False))


def regressor(
    system: System,
    columns: Sequence[Column] | None = None,
    *,
    coordinates: str = "independent",
    moving_base: bool = False,
    **choice: Unpack[ColumnChoice],
) -> Regressor:
    """``regressor(q, v, a) -> D``: joint efforts tau = D K, linear in the dynamic parameters K.

    Joint springs and force elements have no column; see `known_efforts`. A floating base is a free
    joint with six rows.

    Source: Khalil & Creusot 1997, eq. 39.

    Args:
        system: open or closed; q must close the loops.
        columns: parameters, such as `BaseParameters.columns_in_base`. The default is the result of
            `columns_of`.
        coordinates: for a closed system, "independent" for D(q, v_a, a_a) with D = G' D_tree, or
            "tree".
        moving_base: whether to add the inputs v_0, a_0 and R_0 of `mbs.models.inverse_dynamics`.
        choice: options rotors, friction, offsets, couplings and laws of `columns_of`.

    Returns:
        Function of q (nq, 1), v and a (m, 1), v_0, a_0, R_0; D (m, n) with `columns`.

    Raises:
        ModelError: a column is not a parameter of the system. Also the errors of `columns_of`.
    """
    taken = chosen_columns(system, columns, choice)

    def build(s: ModelSymbols) -> tuple[Named, Named]:
        name, a = s.input("a")
        a_tree, tree = s.tree_acceleration(a), system.tree
        around = surroundings(system, moves=moving_base)
        motions = link_accelerations(tree, s.poses, s.v_tree, a_tree, around.base)
        joints, laws = JointColumns.of(tree, s.poses, s.v_tree), LawColumns(system, s)
        D = matrix_of_columns(
            taken,
            inertial_regressor(tree, s.poses, motions),
            lambda column: (
                laws.effort(column)
                if column.symbol
                else joints.effort(column, a_tree, motions, around.base)
            ),
        )
        return [(name, a), *around.inputs], [("D", s.reduced_effort(D))]

    key = ("regressor", moving_base, coordinates)
    return regressor_function(system, key, taken, build)


def known_efforts(
    system: System, coordinates: str = "independent", laws: Sequence[str] = ()
) -> Function:
    """``known_efforts(q, v) -> tau``: joint efforts of springs, stops and force elements.

    They are the difference between the efforts of `mbs.models.inverse_dynamics` and D K.

    Args:
        system: open or closed; q must close the loops.
        coordinates: "independent" or "tree", as for `regressor`.
        laws: symbols of components that are columns of the regressor. Their efforts are excluded.

    Returns:
        Function of q (nq, 1) and v (m, 1); tau (m, 1) [N m or N].

    Raises:
        ModelError: an element of `laws` is not such a symbol.
    """

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        acting = element_efforts(PartsAt(system, s.q, s.v_tree), s.poses)
        columns = LawColumns(system, s)
        for name in laws:
            column = _law_column(system, name, laws)
            acting = acting - columns.effort(column) * system.symbol_table[name]
        if laws:
            chosen = casadi.vertcat(*(system.symbol_table[name] for name in laws))
            acting = casadi.substitute(acting, chosen, SX.zeros(chosen.numel()))
        tau = s.reduced_effort(acting + spring_effort(system.tree, s.q))
        return [("q", s.q), ("v" + s.suffix, s.v)], [("tau" + s.suffix, tau)]

    check = configuration_check(system, coordinates)
    return model_function(system, ("known_efforts", coordinates, *laws), build, check)


def regressor_function(
    system: System,
    key: tuple[str, bool, str],
    columns: tuple[Column, ...],
    build: Callable[[ModelSymbols], tuple[Named, Named]],
) -> Regressor:
    """Return the cached Regressor of a system; it is built at the first call.

    Args:
        system: system of the model.
        key: name of the Function, whether the base moves, and the coordinates ("independent" or
            "tree") of a closed system.
        columns: parameters, one for each column of the outputs.
        build: callable of the model symbols. It returns two lists of (name, expression): the inputs
            after q and v, and the outputs.

    Raises:
        ModelError: the coordinates are not "independent" or "tree".
    """
    coordinates = key[-1]
    check_coordinates(system, coordinates)

    def both() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        inputs, outputs = build(s)
        return [("q", s.q), ("v" + s.suffix, s.v), *inputs], outputs

    def make() -> Regressor:
        check = configuration_check(system, coordinates)
        model: Any = model_function(system, (*key, columns), both, check)
        return Regressor(model, columns)

    made: Regressor = system.cached(("with columns", *key, columns), make)
    return made


def matrix_of_columns(
    columns: tuple[Column, ...], blocks: list[SX], other: Callable[[Column], SX]
) -> SX:
    """Return the matrix (rows, n) with one column for each parameter.

    Args:
        columns: the n parameters.
        blocks: (rows, 10) matrix of each link: columns of its inertial parameters.
        other: callable that returns the column (rows, 1) of any other parameter.
    """
    picked = (
        blocks[column.link - 1][:, INERTIAL.index(column.kind)]
        if column.kind in INERTIAL
        else other(column)
        for column in columns
    )
    return casadi.horzcat(*picked)


# Energy identification model: one row, without accelerations.


def energy_regressor(
    system: System,
    columns: Sequence[Column] | None = None,
    *,
    coordinates: str = "independent",
    **choice: Unpack[ColumnChoice],
) -> Regressor:
    """``energy_regressor(q, v) -> h``: kinetic and potential energy E = h K, with the base at rest.

    The work of the joint efforts over an interval equals the change of h K plus the integral of P
    K, with P from `power_regressor`. The columns of friction and offsets are zero.

    Source: Gautier & Khalil 1988; Khalil & Creusot 1997, eq. 47-52.

    Args:
        system: open or closed; q must close the loops.
        columns: parameters, as for `regressor`.
        coordinates: "independent" or "tree", for a closed system.
        choice: options rotors, friction, offsets, couplings and laws of `columns_of`.

    Returns:
        Function of q (nq, 1) and v (m, 1); h (1, n) with `columns`.

    Raises:
        ModelError: the errors of `regressor`.
    """
    taken = chosen_columns(system, columns, choice)

    def build(s: ModelSymbols) -> tuple[Named, Named]:
        joints = JointColumns.of(system.tree, s.poses, s.v_tree)
        blocks = inertial_energy(system.tree, s.poses, joints.velocities)
        laws = LawColumns(system, s)
        h = matrix_of_columns(
            taken, blocks, lambda c: laws.energy(c) if c.symbol else joints.energy(c)
        )
        return [], [("h", h)]

    return regressor_function(system, ("energy_regressor", False, coordinates), taken, build)


def power_regressor(
    system: System,
    columns: Sequence[Column] | None = None,
    *,
    coordinates: str = "independent",
    **choice: Unpack[ColumnChoice],
) -> Regressor:
    """``power_regressor(q, v) -> P``: power P K that friction and offsets absorb.

    It has the columns of `energy_regressor`; columns of parameters that store energy are zero. The
    integral of P over an interval completes the energy model.

    Args:
        system: open or closed; q must close the loops.
        columns: parameters, as for `regressor`.
        coordinates: "independent" or "tree", for a closed system.
        choice: options rotors, friction, offsets, couplings and laws of `columns_of`.

    Returns:
        Function of q (nq, 1) and v (m, 1); P (1, n) with `columns`.

    Raises:
        ModelError: the errors of `regressor`.
    """
    taken = chosen_columns(system, columns, choice)

    def build(s: ModelSymbols) -> tuple[Named, Named]:
        joints = JointColumns.of(system.tree, s.poses, s.v_tree)
        blocks = [zeros(1, 10) for _ in system.tree.links]
        laws = LawColumns(system, s)
        power = matrix_of_columns(
            taken, blocks, lambda c: laws.power(c) if c.symbol else joints.power(c)
        )
        return [], [("P", power)]

    return regressor_function(system, ("power_regressor", False, coordinates), taken, build)


# Filtered identification model, which needs no accelerations.


def filtered_regressor(
    system: System,
    columns: Sequence[Column] | None = None,
    *,
    coordinates: str = "independent",
    moving_base: bool = False,
    **choice: Unpack[ColumnChoice],
) -> Regressor:
    """``filtered_regressor(q, v) -> D1, D2``: joint efforts tau = d(D1 K)/dt + D2 K.

    D1 K is the derivative of the kinetic energy E in v. D2 K is the derivative of U - E in the
    positions, plus friction and offsets. In independent coordinates, D1 = G' D1_tree and D2 = G'
    D2_tree - dG'/dt D1_tree. A filter on both sides of the equation replaces the time derivative.
    The acceleration of a moving base is not needed.

    Source: Khalil & Restrepo 1996; Khalil & Creusot 1997, eq. 41-44.

    Args:
        system: open or closed; q must close the loops.
        columns: parameters, as for `regressor`.
        coordinates: "independent" or "tree", for a closed system.
        moving_base: whether to add the inputs v_0 and R_0 of `mbs.models.inverse_dynamics`.
        choice: options rotors, friction, offsets, couplings and laws of `columns_of`.

    Returns:
        Function of q (nq, 1), v (m, 1), v_0 and R_0; D1 and D2 (m, n) with `columns`.

    Raises:
        ModelError: the errors of `regressor`.
    """
    taken = chosen_columns(system, columns, choice)

    def build(s: ModelSymbols) -> tuple[Named, Named]:
        tree, base, inputs = _base_motion(system, moving_base)
        joints = JointColumns.of(tree, s.poses, s.v_tree, base)
        momenta = momentum_regressor(tree, s.poses, joints.velocities)
        rests = position_regressor(tree, s.poses, joints.velocities)
        laws = LawColumns(system, s)
        D1 = matrix_of_columns(
            taken, momenta, lambda c: zeros(system.nv) if c.symbol else joints.momentum(c)
        )
        D2 = s.reduced_effort(
            matrix_of_columns(
                taken, rests, lambda c: laws.effort(c) if c.symbol else joints.remaining_effort(c)
            )
        )
        if s.reduction is not None:
            D2 = D2 - casadi.mtimes(_matrix_rate(system, s, s.reduction.G).T, D1)
        return inputs, [("D1", s.reduced_effort(D1)), ("D2", D2)]

    key = ("filtered_regressor", moving_base, coordinates)
    return regressor_function(system, key, taken, build)


def _base_motion(system: System, moves: bool) -> tuple[Tree, Velocity | None, Named]:
    """Return the tree, the base velocity and the named inputs v_0 and R_0 of a moving base.

    Gravity of the tree is then in base axes. Without a moving base: None and no inputs.

    `moves` is whether the base moves.
    """
    if not moves:
        return system.tree, None, []
    v_0, R_0 = SX.sym("v_0", 6), SX.sym("R_0", 3, 3)
    tree = Tree(system.tree.links, casadi.mtimes(R_0.T, system.tree.gravity))
    return tree, Velocity(v_0[0:3], v_0[3:6]), [("v_0", v_0), ("R_0", R_0)]


def _matrix_rate(system: System, s: ModelSymbols, G: SX) -> SX:
    """Return the time derivative of a matrix G that depends on positions only, same shape as G.

    `s` are the symbols of positions and velocities of the model.
    """
    qdot = position_rate(system.tree, s.q, s.v_tree)
    return casadi.reshape(casadi.jtimes(casadi.vec(G), s.q, qdot), *G.shape)
