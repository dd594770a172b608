"""Base inertial parameters: the fewest parameters that give the same equations of motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import ModelFunction, require_system
from mbs.errors import ModelError
from mbs.identification.base.application import with_parameters
from mbs.identification.base.check import Check
from mbs.identification.base.constant_symbols import deciding_symbols, with_constants
from mbs.identification.base.elsewhere import checked_elsewhere, numbers_at
from mbs.identification.base.grouping import Grouping, coefficients
from mbs.identification.base.loops import ClosedPostures
from mbs.identification.base.numeric import (
    RegressorSample,
    applied,
    checked,
    grouped_by_rank,
    preferred_order,
    remainder,
)
from mbs.identification.base.samples import default_parameters, parameter_samples
from mbs.identification.base.states import closed_positions
from mbs.identification.base.structure import Structure, structure_of
from mbs.identification.base.symbolic import grouped_by_rules
from mbs.identification.base.text import equation, table
from mbs.identification.base.turning import postures_needed
from mbs.identification.regressors.columns import Column, chosen_columns, values_of
from mbs.messages import did_you_mean, quoted

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
    def places(self) -> list[int]:
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
        values[self.places] = grouped
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
        system: open or closed; of a closed one the branch of its assembled posture.
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
    postures = _postures(system, seed, symbolic=symbolic)
    grouping = grouped_by_rules(system, sample.columns, postures, structure)
    beta = numbers_at(system, sample.columns, grouping, default_parameters(system))
    check = checked(sample, grouping, beta, order)
    if check.agrees and symbolic and not system.is_closed:
        doubt = checked_elsewhere(system, sample.columns, grouping, order, structure)
        return grouping, doubt or check
    return _completed(sample, grouping, check, order, symbolic=symbolic)


def _completed(
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


def _postures(system: System, seed: int, *, symbolic: bool) -> list[ClosedPostures]:
    """Closed postures at the defaults of the symbols, and at other values where there are any.

    They are others than those of the check.
    """
    if not system.is_closed:
        return []
    values = parameter_samples(system, system.p)[:2] if symbolic else [default_parameters(system)]
    count = postures_needed(system)
    return [ClosedPostures(closed_positions(system, p, count, seed + 1), p) for p in values]


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
