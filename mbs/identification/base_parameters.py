"""Base inertial parameters: the fewest that give the same equations of motion."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import ModelFunction, require_system
from mbs.assembly.tree import Link
from mbs.errors import ModelError
from mbs.expressions import Expression, Parameter
from mbs.expressions.expression import Number, Operation, operation
from mbs.identification.grouping.grouping import (
    Check,
    Grouping,
    Terms,
    coefficients,
    default_parameters,
    equation,
    parameter_samples,
    related,
    sampler,
    table,
    without_zeros,
)
from mbs.identification.grouping.loops import (
    ClosedConfigurations,
    configurations_needed,
    cut_relations,
    pair_relations,
    turning_relations,
)
from mbs.identification.grouping.numeric import (
    RegressorSample,
    applied,
    checked,
    closed_positions,
    grouped_by_rank,
    preferred_order,
    remainder,
)
from mbs.identification.grouping.rules import Key, Structure, structure_of, tree_rules
from mbs.identification.regressors import (
    INERTIAL,
    Column,
    chosen_columns,
    every_column,
    regressor,
    values_of,
)
from mbs.loops.closure import closure_rows
from mbs.spatial import Inertia, elements
from mbs.text import did_you_mean, quoted

# A system whose links and joints have other inertial parameters.


_OF_THE_JOINT = ("Ia", "Fv", "Fs")


def with_parameters(system: System, columns: Sequence[Column], values: SX) -> System:
    """The same mechanism with these parameters, those of no column as they were.

    Masses of its bodies are no longer known. Offsets and motors of two joints stay away, since a
    system has none.

    Args:
        system: open or closed.
        columns: the parameters.
        values: (n, 1) numbers, or expressions of the symbols of the system.
    """
    given: dict[int, dict[str, SX]] = {}
    for column, value in zip(columns, elements(values), strict=True):
        if not column.other:
            given.setdefault(column.link - 1, {})[column.kind] = value
    links = tuple(_with(link, given.get(j, {})) for j, link in enumerate(system.tree.links))
    bodies = tuple(replace(row, mass=None) for row in system.bodies)
    return replace(system, tree=replace(system.tree, links=links), bodies=bodies, _cache={})


def _with(link: Link, values: Mapping[str, SX]) -> Link:
    ten = elements(link.inertia.parameters)
    ten = [values.get(name, old) for name, old in zip(INERTIAL, ten, strict=True)]
    rotor = link.rotor
    if rotor is not None and "Jm" in values:
        rotor = replace(rotor, inertia=values["Jm"])
    joint: dict[str, Any] = {name: values[name] for name in _OF_THE_JOINT if name in values}
    inertia = Inertia.from_parameters(casadi.vertcat(*ten))
    return replace(link, inertia=inertia, rotor=rotor, **joint)


# Symbols that a grouping depends on, and the system in which they are constants.
#
# Columns of the regressor depend on each other in a way that lengths, angles and gravity decide.
# What is found at numbers of these symbols holds there alone, so that a system in which it is
# used must not take other numbers for them.


def deciding_symbols(
    system: System, columns: Sequence[Column], *, base_moves: bool = False
) -> tuple[str, ...]:
    """Names of the parameters on which the regressor or the closed configurations depend.

    Parameters that are only inertial parameters or friction of a link are not among them.

    Args:
        system: open or closed.
        columns: the parameters that are grouped.
        base_moves: whether the base has a motion of its own.
    """
    if not system.parameters:
        return ()
    D = regressor(system, every_column(system, columns), moving_base=base_moves)
    found = {int(k) for k in D.jac_sparsity(0, D.name_in().index("p")).get_col()}
    # The distance of two points of the base decides how loops close, and D may not show it.
    if system.is_closed:
        rows = closure_rows(system, SX.sym("q", system.nq))
        found |= {k for k in range(len(system.parameters)) if casadi.depends_on(rows, system.p[k])}
    return tuple(p.name for k, p in enumerate(system.parameters) if k in found)


def with_constants(system: System, names: Sequence[str]) -> System:
    """The system in which some symbols are the constants of their defaults, and no parameters.

    The input p of its models has the other parameters only: values other than these constants
    cannot be given to it.

    Args:
        system: open or closed.
        names: of the parameters that become constants.

    Raises:
        ModelError: one of them has no default.
    """
    if not names:
        return system
    values: dict[str, float] = {}
    for parameter in system.parameters:
        if parameter.name in names:
            if parameter.default is None:
                raise ModelError(
                    f"{system.name}: parameters are grouped at the default of {parameter.name!r},"
                    " which has none; give it a default where the mechanism is described"
                )
            values[parameter.name] = parameter.default
    rest = [k for k, parameter in enumerate(system.parameters) if parameter.name not in values]
    parameters = tuple(system.parameters[k] for k in rest)
    changed: System = _changer(system.symbol_table, values)(replace(system, _cache={}))
    bounds = {name: own for name, own in system.bounds.items() if name not in values}
    return replace(changed, parameters=parameters, p=system.p[rest], bounds=bounds, _cache={})


def _changer(symbols: Mapping[str, SX], values: Mapping[str, float]) -> Callable[[Any], Any]:
    """What puts numbers into everything that a system holds, expressions of components too."""
    before = casadi.vertcat(*(symbols[name] for name in values))
    after = SX(casadi.DM(np.array(list(values.values()))))
    done: dict[int, tuple[Any, Any]] = {}

    def changed(value: Any) -> Any:
        if isinstance(value, SX):
            return casadi.substitute(value, before, after) if depends(value) else value
        if isinstance(value, Expression):
            return _with_numbers(value, values)
        if id(value) not in done:  # what is shared is changed once
            # kept with the original, so that no other object gets its id
            done[id(value)] = (value, inside(value))
        return done[id(value)][1]

    def depends(value: SX) -> bool:
        return bool(value.nnz()) and bool(casadi.depends_on(value, before))

    def inside(value: Any) -> Any:
        if isinstance(value, tuple | list):
            elements = [changed(element) for element in value]
            same = all(new is old for new, old in zip(elements, value, strict=True))
            return value if same else type(value)(elements)
        if isinstance(value, Mapping):
            return {key: changed(element) for key, element in value.items()}
        if is_dataclass(value) and not isinstance(value, type):
            return _rebuilt(value, changed)
        return value

    return changed


def _rebuilt(value: Any, change: Callable[[Any], Any]) -> Any:
    """A copy of a dataclass with its fields changed; itself where nothing changes."""
    fresh = {f.name: change(getattr(value, f.name)) for f in fields(value)}
    if all(fresh[name] is getattr(value, name) for name in fresh):
        return value
    # Not `replace`: what the constructor computes must be changed too, and is checked already.
    made = copy.copy(value)
    for name, one in fresh.items():
        object.__setattr__(made, name, one)
    return made


def _with_numbers(value: Expression, values: Mapping[str, float]) -> Expression:
    """The expression with numbers in the place of these parameters; others stay symbols."""
    if isinstance(value, Parameter):
        return Number(values[value.name]) if value.name in values else value
    if isinstance(value, Operation):
        return operation(value.operator, *(_with_numbers(a, values) for a in value.arguments))
    return value


# Groupings in numbers, and their check at other values of the symbols than their defaults.


_SEED = 20260412


def numbers_at(
    system: System, columns: Sequence[Column], grouping: Grouping, p: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(kept, columns) the coefficients of a grouping at values p (np,) of the symbols."""
    rows = {k: row for row, k in enumerate(grouping.kept)}
    B = SX(len(rows), len(columns))
    for k, column, x in coefficients(grouping):
        B[rows[k], column] = x
    return np.array(Function("B", [system.p], [casadi.densify(B)])(p))


def checked_elsewhere(
    system: System,
    columns: Sequence[Column],
    grouping: Grouping,
    order: Sequence[int],
    structure: Structure,
) -> Check | None:
    """What states at other values of the symbols say against a grouping; None when nothing.

    Args:
        system: open, with symbols.
        columns: its parameters.
        grouping: by rules.
        order: of preference.
        structure: of its tree.
    """
    p = parameter_samples(system, system.p)[1]
    sample = RegressorSample.of(system, columns, p, _SEED, base_moves=structure.base_moves)
    check = checked(sample, grouping, numbers_at(system, columns, grouping, p), order)
    if check.agrees:
        return None
    told = f"At other values of the symbols than their defaults: {check.text}; nothing is applied"
    return replace(check, text=told)


# Grouping by rules: those of trees, then those of closed loops.


def grouped_by_rules(
    system: System,
    columns: Sequence[Column],
    configurations: Sequence[ClosedConfigurations],
    structure: Structure,
) -> Grouping:
    """What the rules find.

    Args:
        system: open or closed.
        columns: the parameters.
        configurations: that close the loops; none for an open system.
        structure: of its tree.
    """
    indices = _column_indices(columns)
    grouping = _by_tree(structure, Grouping.none(len(columns)), indices)
    sampled = sampler(system)
    if not system.is_closed:
        return without_zeros(grouping, sampled)
    relations = [
        *cut_relations(system),
        *pair_relations(system, configurations, base_moves=structure.base_moves),
        *turning_relations(system, configurations, base_moves=structure.base_moves),
    ]
    for relation in relations:
        terms = _terms(relation, indices)
        if terms is not None:
            grouping = related(grouping, terms, lambda k: columns[k].link, sampled)
    return without_zeros(grouping, sampled)


def _by_tree(structure: Structure, grouping: Grouping, indices: Mapping[Key, int]) -> Grouping:
    for removal in tree_rules(structure):
        dropped, terms = indices.get(removal.parameter), _terms(removal.effects, indices)
        if dropped is not None and terms is not None and dropped in grouping.columns[dropped]:
            grouping = grouping.replaced(dropped, terms)
    return grouping


def _column_indices(columns: Sequence[Column]) -> dict[Key, int]:
    """Numbers of the parameters of one link or joint."""
    return {(c.link - 1, c.kind): k for k, c in enumerate(columns) if not c.other}


def _terms(effects: Mapping[Key, SX], indices: Mapping[Key, int]) -> Terms | None:
    """The combination in numbers of columns; None when a parameter of it is no column."""
    if any(key not in indices for key in effects):
        return None
    return {indices[key]: x for key, x in effects.items()}


# Base inertial parameters: the fewest parameters that give the same equations of motion.


METHODS = ("symbolic", "numeric")


@dataclass(frozen=True, slots=True, eq=False)
class BaseParameters:
    """Base inertial parameters of a system: K_base = B K, and D K = D_kept K_base.

    Attributes:
        system: whose parameters they are; of the numeric method, one in which the symbols that
            the regressor depends on are constants.
        method: "symbolic" or "numeric".
        columns: all parameters K.
        kept: those that remain, with others added to them.
        eliminated: those that leave.
        symbols: (n, 1) a symbol for every parameter, in the order of `columns`.
        grouping: (count, 1) base parameters in these symbols and the parameters of the system.
        matrix: (count, n) B in numbers, at the defaults of the parameters of the system.
        function: ``base_parameters(K) -> K_base``, with the input p when the system has
            parameters.
        check: what random states say about the count and the grouping.
    """

    system: System
    method: str
    columns: tuple[Column, ...]
    kept: tuple[Column, ...]
    eliminated: tuple[Column, ...]
    symbols: SX
    grouping: SX
    matrix: NDArray[np.float64]
    function: Function
    check: Check
    _terms: tuple[Mapping[str, SX], ...]

    def __repr__(self) -> str:
        return f"<BaseParameters {self.system.name}: {self.count} of {len(self.columns)}>"

    @property
    def count(self) -> int:
        """Number of base parameters."""
        return len(self.kept)

    @property
    def indices(self) -> list[int]:
        """Numbers of the kept columns among all."""
        return [self.columns.index(column) for column in self.kept]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the base parameters; R says that others were added, as in "XX2R"."""
        pairs = zip(self.kept, self._terms, strict=True)
        return tuple(f"{c.name}R" if len(terms) > 1 else c.name for c, terms in pairs)

    @property
    def columns_in_base(self) -> tuple[Column, ...]:
        """The kept columns under the names of the base parameters, such as for `regressor`."""
        return tuple(replace(c, name=n) for c, n in zip(self.kept, self.names, strict=True))

    @property
    def equations(self) -> tuple[str, ...]:
        """Every base parameter as text, such as "XX2R = XX2 - YY2 + 0.25*M3"."""
        return tuple(map(equation, self.names, self._terms))

    @property
    def without_effect(self) -> tuple[Column, ...]:
        """Eliminated parameters that are in no base parameter."""
        used = {name for terms in self._terms for name in terms}
        return tuple(column for column in self.eliminated if column.name not in used)

    def text(self) -> str:
        """The set, its equations and the check, in plain lines."""
        rows = [(name, c.unit) for name, c in zip(self.names, self.kept, strict=True)]
        without = ", ".join(column.name for column in self.without_effect) or "none"
        grouped = [c.name for c in self.eliminated if c not in self.without_effect]
        lines = [
            f"{self.system.name}: {self.count} base parameters of {len(self.columns)}",
            *table(rows),
            f"Without effect: {without}",
            f"Grouped with others: {', '.join(grouped) or 'none'}",
            *(
                text
                for text, terms in zip(self.equations, self._terms, strict=True)
                if len(terms) > 1
            ),
            self.check.text,
        ]
        return "\n".join(lines)

    def apply(self) -> System:
        """The system in base parameters: the same equations of motion, most parameters zero.

        Eliminated parameters are zero, kept ones have the grouped values. Links are then no
        longer bodies that could exist; wrenches between them and energies of single links differ.
        It holds for this gravity alone, and for a base at rest unless `moving_base` was said.
        """
        inputs = [values_of(self.system, self.columns)]
        inputs += [self.system.p] if self.system.parameters else []
        grouped = self.function(*inputs)
        values = SX.zeros(len(self.columns))
        values[self.indices] = grouped
        return with_parameters(self.system, self.columns, values)


def base_parameters(
    system: System,
    method: str = "symbolic",
    order: Sequence[str] | None = None,
    columns: Sequence[Column] | None = None,
    *,
    seed: int = 1,
    moving_base: bool = False,
) -> BaseParameters:
    """The base inertial parameters of a system.

    The symbolic method applies rules to the joints, from the last to the first, then to closed
    loops; it keeps symbols of lengths and angles. Random states check the result. What the rules
    did not find is told in `check` and, where it does not depend on symbols, applied too. The
    numeric method takes the rank of the regressor in random states, at the defaults of the symbols
    on which the regressor depends; they are constants in the result: `.system`, `.function` and
    `.apply()` have no such parameter, only those that are inertial parameters themselves.

    Source: Gautier & Khalil 1990 and Khalil & Bennis 1995 for the rules, Gautier 1991 for the
    rank.

    Args:
        system: open or closed; of a closed one the branch of its assembled configuration.
        method: "symbolic" or "numeric".
        order: for the numeric method, names of parameters to keep before all others.
        columns: parameters to look at; `columns_of(system)` when left out.
        seed: of the random states.
        moving_base: whether the base has a motion of its own, which no joint effort produces.

    Raises:
        ModelError: the method or a name is unknown, the loops cannot be closed, or the numeric
            method meets a length, an angle or gravity that is a symbol without default.
    """
    require_system(system)
    _check_method(system, method, order)
    chosen = chosen_columns(system, columns, {})
    first = _first(system, chosen, order or ())
    preference = preferred_order(chosen, first)
    deciding = deciding_symbols(system, chosen, base_moves=moving_base)
    if method == "numeric":
        # What is found at the defaults of these symbols holds there alone.
        system = with_constants(system, deciding)
    sample = RegressorSample.of(
        system, chosen, default_parameters(system), seed, base_moves=moving_base
    )
    if method == "numeric":
        grouping, check = grouped_by_rank(sample, preference)
        return _result(system, method, chosen, grouping, _at_constants(check, deciding))
    structure = structure_of(system, base_moves=moving_base)
    found = _by_rules(system, sample, structure, preference, seed, symbolic=bool(deciding))
    if found is None:
        numeric = base_parameters(
            system, "numeric", columns=chosen, seed=seed, moving_base=moving_base
        )
        told = f"The rules are not exact, so the rank groups the parameters: {numeric.check.text}"
        return replace(
            numeric, method=method, check=replace(numeric.check, agrees=False, text=told)
        )
    return _result(system, method, chosen, *found)


def _at_constants(check: Check, names: Sequence[str]) -> Check:
    """The check, which says at which constants the grouping holds."""
    if not names:
        return check
    return replace(
        check, text=f"{check.text}; it holds at the defaults of {', '.join(names)} alone"
    )


def _by_rules(
    system: System,
    sample: RegressorSample,
    structure: Structure,
    order: Sequence[int],
    seed: int,
    *,
    symbolic: bool,
) -> tuple[Grouping, Check] | None:
    """The grouping that the rules find, checked and completed by random states.

    None where the rules are not exact and the rank has to decide.
    """
    configurations = _configurations(system, seed, symbolic=symbolic)
    grouping = grouped_by_rules(system, sample.columns, configurations, structure)
    beta = numbers_at(system, sample.columns, grouping, default_parameters(system))
    check = checked(sample, grouping, beta, order)
    if check.agrees and symbolic and not system.is_closed:
        doubt = checked_elsewhere(system, sample.columns, grouping, order, structure)
        return grouping, doubt or check
    return _complete(sample, grouping, check, order, symbolic=symbolic)


def _complete(
    sample: RegressorSample,
    grouping: Grouping,
    check: Check,
    order: Sequence[int],
    *,
    symbolic: bool,
) -> tuple[Grouping, Check] | None:
    """The grouping with the relations that the rules missed, where they hold for all symbols."""
    if check.agrees:
        return grouping, check
    if not check.relations:
        return None
    if symbolic:
        told = f"{check.text}; at the defaults of the symbols only, so they are not applied"
        return grouping, replace(check, text=told)
    found = applied(grouping, remainder(sample, grouping, order), grouping.kept)
    told = f"{check.text}; these relations are applied"
    return found, replace(check, applied=True, text=told)


def _configurations(system: System, seed: int, *, symbolic: bool) -> list[ClosedConfigurations]:
    """Closed configurations at the defaults of the symbols, and at other values of them.

    They are others than those of the check.
    """
    if not system.is_closed:
        return []
    values = parameter_samples(system, system.p)[:2] if symbolic else [default_parameters(system)]
    count = configurations_needed(system)
    return [ClosedConfigurations(closed_positions(system, p, count, seed + 1), p) for p in values]


def _result(
    system: System, method: str, columns: tuple[Column, ...], grouping: Grouping, check: Check
) -> BaseParameters:
    kept = grouping.kept
    K = casadi.vertcat(SX(0, 1), *(SX.sym(column.name) for column in columns))
    values = {k: K[k] for k in kept}
    terms: dict[int, dict[str, SX]] = {k: {columns[k].name: SX(1)} for k in kept}
    for k, number, x in coefficients(grouping):
        if number != k:
            values[k] = values[k] + x * K[number]
            terms[k][columns[number].name] = x
    base = casadi.densify(casadi.vertcat(SX(0, 1), *(values[k] for k in kept)))
    inputs = [K, *([system.p] if system.parameters else [])]
    names = ["K", *(["p"] if system.parameters else [])]
    function = Function("base_parameters", inputs, [base], names, ["K_base"], {"cse": True})
    return BaseParameters(
        system=system,
        method=method,
        columns=columns,
        kept=tuple(columns[k] for k in kept),
        eliminated=tuple(c for k, c in enumerate(columns) if k not in kept),
        symbols=K,
        grouping=base,
        matrix=numbers_at(system, columns, grouping, default_parameters(system)),
        function=ModelFunction(function, system),
        check=check,
        _terms=tuple(terms[k] for k in kept),
    )


def _check_method(system: System, method: str, order: Sequence[str] | None) -> None:
    if method not in METHODS:
        raise ModelError(f"{system.name}: method is {quoted(method)}; use 'symbolic' or 'numeric'")
    if order and method == "symbolic":
        raise ModelError(
            f"{system.name}: an order of {len(order)} parameters was given to the symbolic method,"
            " which keeps those near the base; use method='numeric'"
        )


def _first(system: System, columns: Sequence[Column], order: Sequence[str]) -> list[int]:
    names = [column.name for column in columns]
    for name in order:
        if name not in names:
            raise ModelError(
                f"{system.name}: the order names {quoted(name)}, which is no parameter;"
                f" {did_you_mean(name, names)}"
            )
    return [names.index(name) for name in dict.fromkeys(order)]
