"""Base inertial parameters: smallest set of parameters of the equations of motion."""

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
from mbs.expressions._expression import Number, Operation, operation
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
    symbolic_parameters,
)
from mbs.loops.closure_equations import closure_rows
from mbs.spatial import Inertia, elements
from mbs.text import did_you_mean, quoted

# Systems with changed inertial and joint parameters.


_OF_THE_JOINT = ("Ia", "Fv", "Fs")


def with_parameters(system: System, columns: Sequence[Column], values: SX) -> System:
    """Return a copy of the system in which some dynamic parameters have new values.

    Other parameters are unchanged. The masses of its body list become None (unknown). Columns of
    coupled motors are ignored, and so are offsets, since a system does not contain them.

    Args:
        system: open or closed.
        columns: parameters that are replaced: inertial parameters of links, rotor inertias and
            friction of joints.
        values: (n, 1) new value of each column: numbers, or expressions of the symbols of the
            system.
    """
    given: dict[int, dict[str, SX]] = {}
    for column, value in zip(columns, elements(values), strict=True):
        if not column.other:
            given.setdefault(column.link - 1, {})[column.kind] = value
    links = tuple(
        _link_with_values(link, given.get(j, {})) for j, link in enumerate(system.tree.links)
    )
    bodies = tuple(replace(row, mass=None) for row in system.bodies)
    return replace(system, tree=replace(system.tree, links=links), bodies=bodies, _cache={})


def _link_with_values(link: Link, values: Mapping[str, SX]) -> Link:
    """Return a copy of `link` with the parameters in `values` replaced.

    Keys of `values` are kinds of parameters, such as "XX", "M", "Jm" or "Fv".
    """
    ten = elements(link.inertia.parameters)
    ten = [values.get(name, old) for name, old in zip(INERTIAL, ten, strict=True)]
    rotor = link.rotor
    if rotor is not None and "Jm" in values:
        rotor = replace(rotor, inertia=values["Jm"])
    joint: dict[str, Any] = {name: values[name] for name in _OF_THE_JOINT if name in values}
    inertia = Inertia.from_parameters(casadi.vertcat(*ten))
    return replace(link, inertia=inertia, rotor=rotor, **joint)


# Symbols on which a grouping depends, and systems in which they are constants.

# The linear dependence of regressor columns depends on lengths, angles and gravity. A grouping that
# was computed at numeric values of these symbols is valid for these values only, so the system that
# uses it must not accept other values.


def deciding_symbols(
    system: System, columns: Sequence[Column], *, base_moves: bool = False
) -> tuple[str, ...]:
    """Return the names of the system parameters on which the regressor or the loop closure depends.

    These are symbols of lengths, angles and gravity. Symbols that occur only in inertial parameters
    or friction are excluded. The tuple is empty if the system has no symbols.

    Args:
        system: open or closed.
        columns: the dynamic parameters that are grouped.
        base_moves: whether the base has a prescribed motion.
    """
    if not system.parameters:
        return ()
    D = regressor(system, every_column(system, columns), moving_base=base_moves)
    found = {int(k) for k in D.jac_sparsity(0, D.name_in().index("p")).get_col()}
    # Distances between points of the base affect the loop closure, but may be absent from D.
    if system.is_closed:
        rows = closure_rows(system, SX.sym("q", system.nq))
        found |= {k for k in range(len(system.parameters)) if casadi.depends_on(rows, system.p[k])}
    return tuple(p.name for k, p in enumerate(system.parameters) if k in found)


def with_constants(system: System, names: Sequence[str]) -> System:
    """Return a copy of the system with some symbols replaced by their default values.

    The input p of its models contains only the other parameters.

    Args:
        system: open or closed.
        names: names of the parameters that become constants.

    Raises:
        ModelError: a named parameter has no default value.
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
    changed: System = _substitution(system.symbol_table, values)(replace(system, _cache={}))
    bounds = {name: own for name, own in system.bounds.items() if name not in values}
    return replace(changed, parameters=parameters, p=system.p[rest], bounds=bounds, _cache={})


def _substitution(symbols: Mapping[str, SX], values: Mapping[str, float]) -> Callable[[Any], Any]:
    """Return a function that substitutes numbers for symbols in any value of a system.

    It descends into tuples, lists, dicts and dataclasses. `symbols` maps names to SX symbols,
    `values` maps the names to substitute to numbers.
    """
    before = casadi.vertcat(*(symbols[name] for name in values))
    after = SX(casadi.DM(np.array(list(values.values()))))
    done: dict[int, tuple[Any, Any]] = {}

    def changed(value: Any) -> Any:
        if isinstance(value, SX):
            return casadi.substitute(value, before, after) if depends(value) else value
        if isinstance(value, Expression):
            return _with_numbers(value, values)
        if id(value) not in done:  # shared objects are changed once
            # the original is kept alive, so that its id is not reused
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
    """Return a copy of the dataclass `value` with `change` applied to each field.

    The same object is returned if no field changes.
    """
    fresh = {f.name: change(getattr(value, f.name)) for f in fields(value)}
    if all(fresh[name] is getattr(value, name) for name in fresh):
        return value
    # Not `replace`: attributes that the constructor computes must be changed too, without its
    # checks.
    made = copy.copy(value)
    for name, one in fresh.items():
        object.__setattr__(made, name, one)
    return made


def _with_numbers(value: Expression, values: Mapping[str, float]) -> Expression:
    """Return the expression `value` with numbers instead of the parameters named in `values`."""
    if isinstance(value, Parameter):
        return Number(values[value.name]) if value.name in values else value
    if isinstance(value, Operation):
        return operation(value.operator, *(_with_numbers(a, values) for a in value.arguments))
    return value


# Numeric groupings, and their check at values of the symbols other than the defaults.


_SEED = 20260412


def numbers_at(
    system: System, columns: Sequence[Column], grouping: Grouping, p: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the matrix of a grouping at given parameter values.

    Args:
        system: system of the columns.
        columns: the n dynamic parameters.
        grouping: kept columns and the combination of columns of each.
        p: (np,) values of the symbols of the system.

    Returns:
        (kept, n) matrix B with K_base = B K.
    """
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
    """Check a grouping at random states, with other values of the symbols than their defaults.

    Args:
        system: open, with symbols.
        columns: parameters of the system.
        grouping: grouping from the symbolic rules.
        order: column indices in the order in which columns are preferred as base parameters.
        structure: structure of the tree.

    Returns:
        None if the grouping holds. Otherwise the failed check; its text describes the missing
        relations, which are not applied.
    """
    p = parameter_samples(system, system.p)[1]
    sample = RegressorSample.of(system, columns, p, _SEED, base_moves=structure.base_moves)
    check = checked(sample, grouping, numbers_at(system, columns, grouping, p), order)
    if check.agrees:
        return None
    told = f"At other values of the symbols than their defaults: {check.text}; nothing is applied"
    return replace(check, text=told)


# Grouping by symbolic rules: tree rules first, then rules of closed loops.


def grouped_by_rules(
    system: System,
    columns: Sequence[Column],
    configurations: Sequence[ClosedConfigurations],
    structure: Structure,
) -> Grouping:
    """Return the grouping of the parameters that the symbolic rules produce.

    Tree rules are applied first, then the rules of closed loops.

    Args:
        system: open or closed.
        columns: the parameters.
        configurations: configurations that close the loops; empty for an open system.
        structure: structure of the tree.
    """
    indices = _column_indices(columns)
    grouping = _after_tree_rules(structure, Grouping.none(len(columns)), indices)
    sampled = sampler(system)
    if not system.is_closed:
        return without_zeros(grouping, sampled)
    relations = [
        *cut_relations(system),
        *pair_relations(system, configurations, base_moves=structure.base_moves),
        *turning_relations(system, configurations, base_moves=structure.base_moves),
    ]
    for relation in relations:
        terms = _by_column_index(relation, indices)
        if terms is not None:
            grouping = related(grouping, terms, lambda k: columns[k].link, sampled)
    return without_zeros(grouping, sampled)


def _after_tree_rules(
    structure: Structure, grouping: Grouping, indices: Mapping[Key, int]
) -> Grouping:
    """Return `grouping` after the symbolic rules for trees.

    `indices` maps (link index, kind) to the column index. A rule is skipped if one of its
    parameters has no column.

    `structure` contains the joint axes on which the rules depend.
    """
    for removal in tree_rules(structure):
        dropped, terms = indices.get(removal.parameter), _by_column_index(removal.effects, indices)
        if dropped is not None and terms is not None and dropped in grouping.columns[dropped]:
            grouping = grouping.replaced(dropped, terms)
    return grouping


def _column_indices(columns: Sequence[Column]) -> dict[Key, int]:
    """Return a dict from (0-based link index, kind) to the column index.

    Parameters of motors that are coupled to two joints are left out.

    `columns` are regressor columns in order.
    """
    return {(c.link - 1, c.kind): k for k, c in enumerate(columns) if not c.other}


def _by_column_index(effects: Mapping[Key, SX], indices: Mapping[Key, int]) -> Terms | None:
    """Return the linear combination `effects` with column indices as keys.

    `indices` maps (link index, kind) to the column index. None if a parameter has no column.
    """
    if any(key not in indices for key in effects):
        return None
    return {indices[key]: x for key, x in effects.items()}


# Base inertial parameters: smallest set of parameters of the equations of motion.


METHODS = ("symbolic", "numeric")


@dataclass(frozen=True, slots=True, eq=False)
class BaseParameters:
    """Base inertial parameters of a system: K_base = B K, and D K = D_kept K_base.

    Attributes:
        system: system of the parameters. For the numeric method, the symbols on which the regressor
            depends are constants in it.
        method: "symbolic" or "numeric".
        columns: all n parameters K.
        kept: parameters that remain; each base parameter is a kept parameter plus a combination of
            eliminated parameters.
        eliminated: parameters that are removed.
        symbols: (n, 1) symbols of the parameters, in the order of `columns`.
        grouping: (count, 1) base parameters as expressions of `symbols` and the system parameters.
        matrix: (count, n) numeric B, at the default values of the system parameters.
        function: ``base_parameters(K) -> K_base``, with the additional input p if the system has
            parameters.
        check: check of the count and the grouping at random states.
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
    _by_column_index: tuple[Mapping[str, SX], ...]

    def __repr__(self) -> str:
        return f"<BaseParameters {self.system.name}: {self.count} of {len(self.columns)}>"

    @property
    def count(self) -> int:
        """Number of base parameters."""
        return len(self.kept)

    @property
    def indices(self) -> list[int]:
        """Indices of the kept columns in `columns`."""
        return [self.columns.index(column) for column in self.kept]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the base parameters, in the order of `kept`.

        The suffix R, as in "XX2R", marks parameters that contain other parameters.
        """
        pairs = zip(self.kept, self._by_column_index, strict=True)
        return tuple(f"{c.name}R" if len(terms) > 1 else c.name for c, terms in pairs)

    @property
    def columns_in_base(self) -> tuple[Column, ...]:
        """Kept columns, renamed to the base parameters; pass them to `regressor` as its columns."""
        return tuple(replace(c, name=n) for c, n in zip(self.kept, self.names, strict=True))

    @property
    def equations(self) -> tuple[str, ...]:
        """Equation of each base parameter, such as "XX2R = XX2 - YY2 + 0.25*M3"."""
        return tuple(map(equation, self.names, self._by_column_index))

    @property
    def without_effect(self) -> tuple[Column, ...]:
        """Eliminated parameters that occur in no base parameter: no effort depends on them."""
        used = {name for terms in self._by_column_index for name in terms}
        return tuple(column for column in self.eliminated if column.name not in used)

    def text(self) -> str:
        """Return a printable report: base parameters with units, their equations, and the check.

        The check confirms their number and their equations at random states.
        """
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
                for text, terms in zip(self.equations, self._by_column_index, strict=True)
                if len(terms) > 1
            ),
            self.check.text,
        ]
        return "\n".join(lines)

    def apply(self) -> System:
        """Return a system with the base parameters and the same equations of motion.

        Eliminated parameters are zero and kept parameters have the grouped values. The links are no
        longer physical bodies; wrenches between links and energies of single links differ. The
        result is valid for the present gravity only, and for a base at rest unless `moving_base`
        was set.
        """
        inputs = [symbolic_parameters(self.system, self.columns)]
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
    """Compute the base inertial parameters of a system.

    The symbolic method applies rules to the joints, from the last to the first, then to the closed
    loops, and keeps symbols of lengths and angles. The result is checked at random states.
    Relations that the rules miss are reported in `check`; they are also applied if they do not
    depend on symbols. The numeric method computes the rank of the regressor at random states, at
    the default values of the symbols on which the regressor depends. These symbols are constants in
    the `.system`, `.function` and `.apply()` of the result. Symbols that are inertial parameters
    remain parameters.

    Source: Gautier & Khalil 1990 and Khalil & Bennis 1995 for the rules, Gautier 1991 for the rank.

    Args:
        system: open or closed. A closed system is treated on the branch of its assembled
            configuration.
        method: "symbolic" or "numeric".
        order: names of parameters to keep with priority, for the numeric method.
        columns: parameters to group; `columns_of(system)` by default.
        seed: seed of the random states.
        moving_base: whether the base has a prescribed motion, which no joint effort produces.

    Raises:
        ModelError: the method or a name is unknown, the loops cannot be closed, or a length, an
            angle or gravity is a symbol without default value and the numeric method is used.
    """
    require_system(system)
    _check_method(system, method, order)
    chosen = chosen_columns(system, columns, {})
    first = _priority_indices(system, chosen, order or ())
    preference = preferred_order(chosen, first)
    deciding = deciding_symbols(system, chosen, base_moves=moving_base)
    if method == "numeric":
        # The result at the default values of these symbols is valid for these values only.
        system = with_constants(system, deciding)
    sample = RegressorSample.of(
        system, chosen, default_parameters(system), seed, base_moves=moving_base
    )
    if method == "numeric":
        grouping, check = grouped_by_rank(sample, preference)
        return _base_parameters_of(
            system, method, chosen, grouping, _noting_constants(check, deciding)
        )
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
    return _base_parameters_of(system, method, chosen, *found)


def _noting_constants(check: Check, names: Sequence[str]) -> Check:
    """Return `check` with a note that the grouping holds only at the defaults of the `names`."""
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
    """Return the grouping of the symbolic rules and its check at the random states of `sample`.

    `order` lists column indices by preference; `symbolic` is whether the regressor depends on
    symbols. None if the rules are not exact, so that the numeric rank must be used.
    """
    configurations = _configurations(system, seed, symbolic=symbolic)
    grouping = grouped_by_rules(system, sample.columns, configurations, structure)
    beta = numbers_at(system, sample.columns, grouping, default_parameters(system))
    check = checked(sample, grouping, beta, order)
    if check.agrees and symbolic and not system.is_closed:
        doubt = checked_elsewhere(system, sample.columns, grouping, order, structure)
        return grouping, doubt or check
    return _completed_numerically(sample, grouping, check, order, symbolic=symbolic)


def _completed_numerically(
    sample: RegressorSample,
    grouping: Grouping,
    check: Check,
    order: Sequence[int],
    *,
    symbolic: bool,
) -> tuple[Grouping, Check] | None:
    """Add the relations that the rules missed to `grouping`; return it with its check.

    If `symbolic`, they hold only at the default values of the symbols and are not added. None if
    `check` failed without giving such relations.
    """
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
    """Return random configurations that close the loops; an empty list for an open system.

    They are drawn with `seed` + 1, at the default values of the symbols and, if `symbolic`, also
    at other values.
    """
    if not system.is_closed:
        return []
    values = parameter_samples(system, system.p)[:2] if symbolic else [default_parameters(system)]
    count = configurations_needed(system)
    return [ClosedConfigurations(closed_positions(system, p, count, seed + 1), p) for p in values]


def _base_parameters_of(
    system: System, method: str, columns: tuple[Column, ...], grouping: Grouping, check: Check
) -> BaseParameters:
    """Return the `BaseParameters` of a grouping, with matrix, expressions and CasADi function.

    `columns` are all parameters, `grouping` and `check` are results of `method`, a name such as
    "symbolic".
    """
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
        _by_column_index=tuple(terms[k] for k in kept),
    )


def _check_method(system: System, method: str, order: Sequence[str] | None) -> None:
    """Raise ModelError if the method is unknown or does not accept an order."""
    if method not in METHODS:
        raise ModelError(f"{system.name}: method is {quoted(method)}; use 'symbolic' or 'numeric'")
    if order and method == "symbolic":
        raise ModelError(
            f"{system.name}: an order of {len(order)} parameters was given to the symbolic method,"
            " which keeps those near the base; use method='numeric'"
        )


def _priority_indices(system: System, columns: Sequence[Column], order: Sequence[str]) -> list[int]:
    """Return the column indices of the parameters named in `order`, which are kept with priority.

    Raises ModelError for an unknown name.

    `columns` are all parameters.
    """
    names = [column.name for column in columns]
    for name in order:
        if name not in names:
            raise ModelError(
                f"{system.name}: the order names {quoted(name)}, which is no parameter;"
                f" {did_you_mean(name, names)}"
            )
    return [names.index(name) for name in dict.fromkeys(order)]
