"""How every model becomes a casadi.Function: names, parameters with defaults, checked calls."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi
import numpy as np
from casadi import DM, MX, SX, Function, Sparsity
from numpy.typing import NDArray

from mbs.assembly.system import System
from mbs.assembly.tables import ACCELERATION_UNIT, EFFORT_UNIT
from mbs.assembly.tree import quaternion_slices
from mbs.assembly.validity import ValidityRow, all_hold, plain_fault, plain_rows
from mbs.errors import ModelError
from mbs.numbers import doubles
from mbs.operations.pipeline import names_found
from mbs.text import quoted

if TYPE_CHECKING:
    from mbs.assembly.system import System


# The table that says what each element of the inputs and outputs of a model is.


_QUANTITIES = {
    "q": "position",
    "v": "velocity",
    "a": "acceleration",
    "tau": "effort",
    "p": "parameter",
    "z": "state",
    "u": "input",
    "y": "output",
}


def function_table(function: ModelFunction) -> str:
    """One line for each input and output, and one for each of its elements that has a name.

    Args:
        function: the model; q, v, a and tau are in the order of the coordinates of its system, and
            those that end in _a are of the independent joints.

    Returns:
        Lines of index, name, quantity and unit; parameters with their defaults, and positions,
        velocities and efforts with the limits that the joints describe.
    """
    lines = [f"{function.name()} of {function.system.name}"]
    for kind, names, shape in (
        ("input", function.name_in(), function.size_in),
        ("output", function.name_out(), function.size_out),
    ):
        for name in names:
            lines += [
                f"{kind} {name} {shape(name)}",
                *_rows_of_elements(function, name, shape(name)[0]),
            ]
    return "\n".join(lines)


def _rows_of_elements(function: ModelFunction, name: str, size: int) -> list[str]:
    rows = function.elements(name)
    if len(rows) != size:
        return []
    quantity = _QUANTITIES.get(name.removesuffix("_a"), "")
    defaults = function.system.parameter_values(needed=()) if name == "p" else []
    limits = _limits(function.system, name.removesuffix("_a"))
    width = max((len(element) for element, _ in rows), default=0)
    return [
        f"  {k:>3}  {element:<{width}}  {quantity} [{unit}]{limits.get(element, '')}"
        + (f" = {defaults[k]:g}" if k < len(defaults) and defaults[k] == defaults[k] else "")
        for k, (element, unit) in enumerate(rows)
    ]


def _limits(system: System, name: str) -> dict[str, str]:
    """What to write of the limits of the elements of an input, by the name of the element."""
    ranges = {
        "q": [(row.name, row.limits) for row in system.coordinates],
        "v": [(row.name, row.limits) for row in system.speeds],
        "tau": [(row.name, row.effort) for row in system.speeds],
    }
    return {
        element: f" {ends[0]:g} .. {ends[1]:g}"
        for element, ends in ranges.get(name, [])
        if ends is not None
    }


Named = Sequence[tuple[str, SX]]
"""Inputs or outputs of a model: name and value."""


@dataclass(frozen=True, slots=True)
class ConfigurationCheck:
    """What a model asks of a configuration beside what every model does.

    Attributes:
        rows: `rows(system, q)` at symbols q and `system.p`.
        refuse: `refuse(system, q, p)` raises the error that says why numbers are not taken.
        verify: `verify(system, names, evaluate, inputs, outputs)` raises an error if numeric
            outputs, in the order of their names, have no accuracy; `evaluate(inputs)` returns the
            outputs at other inputs. None if nothing is verified.
        delicate: `delicate(system, q)` is an expression of q and `system.p`, 1 at configurations at
            which outputs are verified, else 0. None if there are no such configurations.
    """

    rows: Callable[[System, SX], list[ValidityRow]]
    refuse: Callable[[System, Any, Any], None]
    verify: Callable[[System, list[str], Any, dict[str, Any], Sequence[DM]], None] | None = None
    delicate: Callable[[System, SX], SX] | None = None


_SAME_UNIT = {unit: unit for unit in EFFORT_UNIT}


class ModelFunction(Function):
    """A casadi.Function that knows the names of its elements and the defaults of its parameters.

    It is called like any Function. The last input p may be left out: its defaults are taken
    (CasADi's own `default_in` holds one number per input, so it cannot keep them). A call with a
    wrong number of values says so by the names of the coordinates, and numbers in never give a
    NaN out, but in `may_be_nan`.

    Attributes:
        may_be_nan: outputs of which some elements are NaN where there is nothing to say.
    """

    may_be_nan: tuple[str, ...] = ()

    def __init__(
        self,
        function: Function,
        system: System,
        annotate: Callable[[], Function] | None = None,
        check: ConfigurationCheck | None = None,
        loops: Any = None,
    ) -> None:
        """Take a Function for a model.

        Args:
            function: the equations.
            system: the mechanism.
            annotate: gives the Function with its intermediate quantities.
            check: what is asked of a configuration.
            loops: what `mbs.native.compiled` asks for code that loops over the links.
        """
        Function.__init__(self, function)
        self.loops = loops
        self._system = system
        self._annotate = annotate
        self._check_configuration = check
        self._sizes = {name: self.size_in(name) for name in self.name_in()}
        self._of_one: Function | None = None
        self._state: Function | None = None
        # what a call asks beyond finite numbers; the rows themselves are made when first needed
        ruled = system.bounds or system.bounded or quaternion_slices(system.tree)
        self._asks = bool(check or ruled)

    @property
    def system(self) -> System:
        """The mechanism whose model it is."""
        return self._system

    def annotated(self) -> Function:
        """The same Function with further outputs: the intermediate quantities that have a name.

        Returns:
            Function of the same inputs; after its own outputs come scalars such as W32, the third
            element of the angular velocity of link 2. Names are those of docs/notation.md.
        """
        return Function(self) if self._annotate is None else self._annotate()

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Evaluate it on numbers or symbols, as a casadi.Function, its inputs checked."""
        given = self._given(args, kwargs)
        inputs = {name: self._input(name, value) for name, value in given.items()}
        delicate = self._require_valid(inputs)
        try:
            outputs = Function.__call__(self, *inputs.values())
        except (RuntimeError, NotImplementedError, TypeError, ValueError) as error:
            raise ModelError(
                f"{self._title}: CasADi does not take these arguments; give numbers, DM, SX or MX"
                f" of the shapes {self._shapes()}"
            ) from error
        self._require_numbers(outputs)
        if delicate:
            self._verify(inputs, outputs)
        if kwargs:
            every = outputs if isinstance(outputs, tuple) else (outputs,)
            return dict(zip(self.name_out(), every, strict=True))
        return outputs

    def __reduce__(self) -> tuple[Any, ...]:
        """A pickle holds the System too, so that names, defaults and checks go with it."""
        return _unpickle, (self.serialize(), self._system, self._check_configuration, self.loops)

    def __deepcopy__(self, dummy: Any = None) -> ModelFunction:
        """Itself: a Function never changes."""
        return self

    def like(self, function: Function) -> ModelFunction:
        """Another Function with the inputs of this one, checked and completed in the same way."""
        made = ModelFunction(function, self._system, check=self._check_configuration)
        made.may_be_nan = self.may_be_nan
        return made

    def asked(self) -> tuple[str, ...]:
        """The inputs of which more than finite numbers is asked: positions q, parameters p."""
        sizes = {"q": self._system.nq, "p": len(self._system.parameters)}
        return tuple(
            name
            for name, size in sizes.items()
            if self._asks and size and self._sizes.get(name, (0,))[0] == size
        )

    def rows(self, q: SX) -> list[ValidityRow]:
        """What is asked of the inputs `asked`; empty where it is nothing.

        Args:
            q: (nq, 1) symbols; parameters are those of the system.
        """
        asked, check = self.asked(), self._check_configuration
        if not asked:
            return []
        of = {"parameter": "p"}
        rows = [row for row in plain_rows(self._system, q) if of.get(row.kind, "q") in asked]
        return [*rows, *(check.rows(self._system, q) if check and "q" in asked else [])]

    def valid(self) -> Function | None:
        """``valid(q, p)``, of those of them that are asked: 1 where the model takes all columns.

        Returns:
            None where it asks for nothing but numbers.
        """
        one = self._valid_of_one()
        if one is None:
            return None
        width = max(self._sizes[name][1] for name in one.name_in())
        if width == 1:
            return one
        given = [MX.sym(name, *self._sizes[name]) for name in one.name_in()]
        every = casadi.mmin(one.map(width)(*given))
        return Function("valid", given, [every], one.name_in(), ["valid"])

    def _valid_of_one(self) -> Function | None:
        """`valid` of one column."""
        if self._of_one is None:
            q = SX.sym("q", self._system.nq)
            if not (rows := self.rows(q)):
                return None
            symbols = {"q": q, "p": self._system.p}
            key = self.asked(), self._check_configuration
            inputs = {name: symbols[name] for name in self.asked()}
            self._of_one = all_hold(self._system, key, inputs, rows)
        return self._of_one

    def _state_of_one(self) -> Function | None:
        """``state(..) -> valid, delicate`` of one column; common parts are evaluated once."""
        if self._state is None and (valid := self._valid_of_one()) is not None:
            symbols = {"q": SX.sym("q", self._system.nq), "p": self._system.p}
            given, check = [symbols[name] for name in valid.name_in()], self._check_configuration
            expression = check.delicate if check and "q" in valid.name_in() else None

            def build() -> Function:
                delicate = SX(0) if expression is None else expression(self._system, symbols["q"])
                return Function("state", given, [valid(*given), delicate], {"cse": True})

            self._state = self._system.cached(("state", self.asked(), check), build)
        return self._state

    def default_of_p(self) -> NDArray[np.float64] | None:
        """Values of the parameters where they are left out; None where one has no value."""
        try:
            return np.array(self._system.parameter_values(), dtype=float)
        except ModelError:
            return None

    def rewritten(self, function: Function) -> ModelFunction:
        """An equal Function of other operations, its intermediate quantities named as here."""
        made = self.like(function)
        if self._annotate is not None:
            made._annotate = lambda: names_found(Function(function), self.annotated())
        return made

    def map(self, *args: Any) -> Function:
        """The Function over many columns, as `casadi.Function.map`."""
        return self.like(Function.map(self, *args))

    def expand(self, *args: Any) -> Function:
        """The Function on scalars alone, as `casadi.Function.expand`."""
        return self.like(Function.expand(self, *args))

    def elements(self, name: str) -> list[tuple[str, str]]:
        """Name and unit of every element of an input or output; empty where they have none."""
        return _elements(self._system).get(name, [])

    def describe(self) -> str:
        """A table of index, name, quantity and unit of every input and output; `print` shows it."""
        return function_table(self)

    def __str__(self) -> str:
        """The table of `describe`; `repr` is the one line of CasADi."""
        return self.describe()

    def example(self, name: str) -> NDArray[np.float64] | None:
        """Numbers that an input takes, where not all would do; None where any will do."""
        return self.default_of_p() if name == "p" else None

    @property
    def _title(self) -> str:
        return f"{self.name()}({self._system.name})"

    def _given(self, args: tuple[Any, ...], kwargs: dict[str, Any]) -> dict[str, Any]:
        """Every input by name, p completed by its defaults."""
        names = self._sizes
        given = dict(zip(names, args, strict=False))
        twice = [name for name in kwargs if name in given]
        if twice:
            raise ModelError(
                f"{self._title}: {twice[0]} is given by its place and by its name; give it once"
            )
        given |= kwargs
        if "p" in names and "p" not in given:
            values = DM(self._system.parameter_values())
            given["p"] = casadi.repmat(values, 1, self._sizes["p"][1])
        if len(args) > len(names) or set(given) != set(names):
            wrong = [name for name in kwargs if name not in names]
            missing = [name for name in names if name not in given]
            what = (
                f"there is no input {wrong[0]!r}" if wrong else f"{' and '.join(missing)} missing"
            )
            if len(args) > len(names):
                what = f"{len(args)} arguments were given"
            raise ModelError(f"{self._title}: {what}; the inputs are {self._shapes()}")
        return {name: given[name] for name in names}

    def _input(self, name: str, value: Any) -> Any:
        """What CasADi takes for a value: finite numbers of the size of an input, or symbols."""
        if isinstance(value, (list, tuple)) and any(isinstance(e, (SX, MX, DM)) for e in value):
            value = casadi.vertcat(*value)
        if isinstance(value, (SX, MX, DM)):
            self._check_size(name, value.shape, value)
            finite = not isinstance(value, DM) or value.is_regular()
        else:
            array = doubles(value)
            if isinstance(array, str):
                raise ModelError(f"{self._title}: {name} {array}")
            self._check_size(name, array.shape, value)
            line = array.ndim == 1 and array.size > 0
            # the sum of squares is the fastest question, which a large number may also answer
            finite = (line and math.isfinite(array.dot(array))) or bool(np.isfinite(array).all())
            checked = self._asks and name in ("q", "p")
            value = array if line and not checked else _dm(array)
        if not finite:
            raise ModelError(f"{self._title}: {name} is not finite; give numbers")
        return value

    def _check_size(self, name: str, shape: tuple[int, ...], value: Any) -> None:
        expected, width = self._sizes[name]
        rows, columns = (*shape, 1, 1)[:2]
        if width > 1 and not self.elements(name):
            if rows == expected and columns % width == 0:
                return
            raise ModelError(
                f"{self._title}: {name} has the shape {shape}, it needs {(expected, width)}"
            )
        square = shape == (expected, expected) and expected > 1 and width != expected
        if square and not isinstance(value, (SX, MX, DM)):
            raise ModelError(
                f"{self._title}: {name} is an array of shape {shape}, whose states may be rows or"
                " columns; give casadi.DM(array), whose columns are states, or take"
                " mbs.native.batch, whose rows are"
            )
        if len(shape) <= 2 and (rows == expected or (rows, columns) == (1, expected)):
            return
        if shape == () and isinstance(value, (int, float)) and value == 0:
            return
        elements = ", ".join(element for element, _ in self.elements(name))
        known = f": {elements}" if elements else ""
        has = f"the shape {shape}" if len(shape) > 1 else f"{rows} values"
        raise ModelError(f"{self._title}: {name} has {has}, it needs {expected}{known}")

    def _require_valid(self, inputs: dict[str, Any]) -> bool:
        """Refuse numbers at which the model has no sense; return whether to verify its outputs."""
        one = self._state_of_one() if self._asks else None
        if one is None:
            return False
        system, names = self._system, self.asked()
        point = [inputs[name] for name in names]
        sizes = [(one.size1_in(k), 1) for k in range(len(names))]
        if all(isinstance(x, DM) for x in point) and [x.shape for x in point] == sizes:
            valid, delicate = one.call(point)
            if valid == 1:
                return bool(delicate == 1)
        columns = {
            name: _columns(inputs[name], size) for name, (size, _) in zip(names, sizes, strict=True)
        }
        known = {name: values for name, values in columns.items() if values is not None}
        whole = len(known) == len(names)
        count = max((values.shape[1] for values in known.values()), default=0)
        places = {name: np.arange(count) % values.shape[1] for name, values in known.items()}
        suspects, is_delicate = np.arange(count), False
        if whole and count:
            every = [_dm(known[name][:, places[name]]) for name in names]
            valid, delicate = (x.full().ravel() for x in one.map(count).call(every))
            suspects, is_delicate = np.flatnonzero(valid != 1), bool(np.any(delicate == 1))
        for k in suspects:
            column = {name: values[:, places[name][k]] for name, values in known.items()}
            if fault := plain_fault(system, column.get("q"), column.get("p")):
                raise ModelError(f"{self._title}: {fault}")
            if whole:
                self._refuse(column)
        return is_delicate

    def _refuse(self, column: dict[str, NDArray[np.float64]]) -> None:
        """Say what is wrong where no component and no quaternion has a sentence for it."""
        given = {name: _dm(values) for name, values in column.items()}
        if self._check_configuration is not None and "q" in given:
            self._check_configuration.refuse(self._system, given["q"], given.get("p", DM()))
        q = SX.sym("q", self._system.nq)
        rows, symbols = self.rows(q), {"q": q, "p": self._system.p}
        excess = casadi.vertcat(*(row.residual - row.bound for row in rows))
        found = Function("rows", [symbols[name] for name in given], [excess])(*given.values())
        broken = rows[int(np.argmin(found.full().ravel() <= 0))]
        raise ModelError(f"{self._title}: {broken.sentence}")

    def _verify(self, inputs: dict[str, Any], outputs: Any) -> None:
        """Raise an error if outputs of numeric inputs have no accuracy."""
        check = self._check_configuration
        every = outputs if isinstance(outputs, tuple) else (outputs,)
        if check is None or check.verify is None or not all(isinstance(o, DM) for o in every):
            return

        def evaluate(values: Mapping[str, DM]) -> list[DM]:
            return list(Function.call(self, [*values.values()]))

        check.verify(self._system, self.name_out(), evaluate, inputs, every)

    def _require_numbers(self, outputs: Any) -> None:
        every = outputs if isinstance(outputs, tuple) else (outputs,)
        names = self.name_out() if self.may_be_nan else itertools.repeat("")
        if all(
            isinstance(o, (SX, MX)) or o.is_regular() or name in self.may_be_nan
            for o, name in zip(every, names, strict=False)
        ):
            return
        loops = ", no configuration closes the loops there" if self._system.is_closed else ""
        raise ModelError(
            f"{self._title}: the result is not a number; an input is not finite{loops}, a parameter"
            " takes a value that has no sense, or the configuration is singular"
        )

    def _shapes(self) -> str:
        sizes = (f"{name} {self.size_in(name)}" for name in self.name_in())
        return ", ".join(sizes)


def _dm(array: NDArray[np.float64]) -> DM:
    """An array as CasADi takes it; given a pattern, it converts in half the time."""
    rows, columns = (*array.shape, 1, 1)[:2]
    return DM(Sparsity.dense(rows, columns), array.ravel(order="F"))


def _columns(value: DM | SX | MX | None, rows: int) -> NDArray[np.float64] | None:
    """(rows, n) the configurations in an input; None where it is symbolic or of another size."""
    if not isinstance(value, DM) or rows == 0:
        return None
    full = value.full()
    if full.shape == (1, rows):
        full = full.T
    if full.shape == (1, 1) and full[0, 0] == 0:  # CasADi's zero for all elements
        full = np.zeros((rows, 1))
    return full if full.shape[0] == rows else None


def _unpickle(
    data: str, system: System, check: ConfigurationCheck | None, loops: Any
) -> ModelFunction:
    return ModelFunction(Function.deserialize(data), system, check=check, loops=loops)


def model_function(
    system: System,
    key: tuple[Any, ...],
    build: Callable[[], tuple[Named, Named] | tuple[Named, Named, Named]],
    check: ConfigurationCheck | None = None,
    loops: Any = None,
) -> Function:
    """The model of a system under this key, built the first time it is asked for.

    Args:
        system: whose model it is; its cache keeps the Function.
        key: the name of the Function, then whatever distinguishes it from others of the same name.
        build: gives the named inputs and outputs on CasADi symbols and, where there are any, the
            named scalars between them. When the system has parameters they become the last
            input p.
        check: what refuses positions q given in numbers.
        loops: what `mbs.native.compiled` asks for code that loops over the links.

    Raises:
        ModelError: `system` is not a System.
    """
    require_system(system)

    def make() -> Function:
        inputs, outputs, *between = build()
        every = [*inputs, *signals_in(system, inputs, outputs)]
        options: dict[str, Any] = {"cse": True, "default_in": default_in(system, len(every))}
        every += [("p", system.p)] if system.parameters else []

        def function(results: Named) -> Function:
            values = [casadi.densify(value) for _, value in results]
            names = [name for name, _ in every], [name for name, _ in results]
            return Function(str(key[0]), [x for _, x in every], values, *names, options)

        annotate = (lambda: function([*outputs, *between[0]])) if between else None
        return ModelFunction(function(outputs), system, annotate, check, loops)

    function: Function = system.cached(key, make)
    return function


def signals_in(system: System, inputs: Named, outputs: Named) -> Named:
    """The states z and inputs u of components, where they are no inputs yet and outputs need them.

    Args:
        system: whose components they are.
        inputs: named ones of a model.
        outputs: likewise.
    """
    given = {name for name, _ in inputs}
    found = [("z", system.z), ("u", system.u)]
    needed = casadi.veccat(*(value for _, value in outputs))
    return [
        (name, symbols)
        for name, symbols in found
        if name not in given and symbols.numel() and casadi.depends_on(needed, symbols)
    ]


def default_in(system: System, others: int) -> list[float]:
    """CasADi's own defaults: of p where one number can be it, else NaN, which shows."""
    if not system.parameters:
        return [0.0] * others
    values = set(system.p_default)
    return [0.0] * others + [values.pop() if len(values) == 1 else float("nan")]


def require_system(system: object) -> None:
    """Refuse what is not a System, such as a mechanism that was not assembled.

    Raises:
        ModelError: says what to call.
    """
    if not isinstance(system, System):
        name = getattr(system, "name", None)
        what = f"{name if isinstance(name, str) else quoted(system)} ({type(system).__name__})"
        assembles = hasattr(system, "assemble")
        remedy = "call assemble() first" if assembles else "give what assemble() returns"
        raise ModelError(f"{what} is not a System, of which models are made; {remedy}")


def _elements(system: System) -> dict[str, list[tuple[str, str]]]:
    q = [(coordinate.name, coordinate.unit) for coordinate in system.coordinates]
    free = [system.speeds[k] for k in system.free]
    units = {"v": _SAME_UNIT, "a": ACCELERATION_UNIT, "tau": EFFORT_UNIT}
    result = {"q": q, "p": [(parameter.name, parameter.unit) for parameter in system.parameters]}
    result["q_a"] = [(speed.name, speed.unit.removesuffix("/s")) for speed in free]
    for name, unit in units.items():
        every = [(speed.name, unit[speed.unit]) for speed in system.speeds]
        result[name] = every
        result[f"{name}_a"] = [every[k] for k in system.active]
    result["tau_m"] = [result["tau"][k] for k in system.motors]
    result |= {"z": list(system.states), "u": list(system.inputs), "y": list(system.outputs)}
    return result
