"""Models as casadi.Functions with element names, default parameters and checked calls."""

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


# Table of the elements of the inputs and outputs of a model.


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
    """Return a table with a line for each input and output, and for each of its named elements.

    Args:
        function: model. The order of q, v, a and tau is that of the coordinates of its system.
            Names that end in _a refer to the independent joints.

    Returns:
        lines of index, name, quantity and unit. Parameters have their defaults, and positions,
        velocities and efforts have the limits of the joints.
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
    """Return a line of text for each element of the input or output `name`.

    Empty if the number of named elements differs from `size`.
    """
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
    """Return the text of the limits of each element of an input, by name of the element."""
    ranges = {
        "q": [(row.name, row.limits) for row in system.coordinates],
        "v": [(row.name, row.limits) for row in system.velocity_coordinates],
        "tau": [(row.name, row.effort) for row in system.velocity_coordinates],
    }
    return {
        element: f" {ends[0]:g} .. {ends[1]:g}"
        for element, ends in ranges.get(name, [])
        if ends is not None
    }


Named = Sequence[tuple[str, SX]]
"""Named inputs or outputs of a model: pairs of name and value."""


@dataclass(frozen=True, slots=True)
class ConfigurationCheck:
    """Additional validity conditions of a model on its configuration.

    Attributes:
        rows: `rows(system, q)` returns the conditions at symbols q and `system.p`.
        refuse: `refuse(system, q, p)` raises an error with the reason if numbers are invalid.
        verify: `verify(system, names, evaluate, inputs, outputs)` raises an error if numeric
            outputs, in the order of their names, are inaccurate. `evaluate(inputs)` returns the
            outputs at other inputs. None if outputs are not verified.
        delicate: `delicate(system, q)` is an expression of q and `system.p`, 1 at configurations at
            which outputs are verified, else 0. None if there are no such configurations.
    """

    rows: Callable[[System, SX], list[ValidityRow]]
    refuse: Callable[[System, Any, Any], None]
    verify: Callable[[System, list[str], Any, dict[str, Any], Sequence[DM]], None] | None = None
    delicate: Callable[[System, SX], SX] | None = None


_SAME_UNIT = {unit: unit for unit in EFFORT_UNIT}


class ModelFunction(Function):
    """A casadi.Function with names of its elements and defaults of its parameters.

    It is called like any Function. The last input p may be left out and then has its defaults
    (CasADi's own `default_in` has a single number per input). The error for a wrong number of
    values lists the coordinates. NaN in the outputs of numeric inputs raises an error, except in
    `may_be_nan`.

    Attributes:
        may_be_nan: names of outputs with elements that may be NaN if they are undefined.
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
        """Create a model from a Function.

        Args:
            function: equations of the model.
            system: system of the model.
            annotate: callable that returns the Function with its intermediate quantities.
            check: additional validity conditions on the configuration.
            loops: source of code that loops over the links, for `mbs.native.compiled`.
        """
        Function.__init__(self, function)
        self.loops = loops
        self._system = system
        self._annotate = annotate
        self._check_configuration = check
        self._sizes = {name: self.size_in(name) for name in self.name_in()}
        self._of_one: Function | None = None
        self._state: Function | None = None
        # whether inputs have conditions beyond finite numbers; the rows are made when first needed
        ruled = system.bounds or system.bounded or quaternion_slices(system.tree)
        self._asks = bool(check or ruled)

    @property
    def system(self) -> System:
        """System of the model."""
        return self._system

    def annotated(self) -> Function:
        """Return the Function with further outputs: the named intermediate quantities.

        Returns:
            Function of the same inputs. After its own outputs it has scalars such as W32, the third
            element of the angular velocity of link 2. The names are listed in docs/notation.md.
        """
        return Function(self) if self._annotate is None else self._annotate()

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Evaluate the model on numbers or symbols, as a casadi.Function, with checked inputs."""
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
        """Pickle the model with its System, so that names, defaults and checks are kept."""
        return _unpickle, (self.serialize(), self._system, self._check_configuration, self.loops)

    def __deepcopy__(self, dummy: Any = None) -> ModelFunction:
        """Return the model itself: a Function is immutable."""
        return self

    def like(self, function: Function) -> ModelFunction:
        """Return a model with another Function of the same inputs, with the same checks.

        Args:
            function: Function with the inputs of this model, such as a derivative or compiled code.
        """
        made = ModelFunction(function, self._system, check=self._check_configuration)
        made.may_be_nan = self.may_be_nan
        return made

    def asked(self) -> tuple[str, ...]:
        """Return the names of the inputs that have validity conditions: "q", "p", both or none."""
        sizes = {"q": self._system.nq, "p": len(self._system.parameters)}
        return tuple(
            name
            for name, size in sizes.items()
            if self._asks and size and self._sizes.get(name, (0,))[0] == size
        )

    def rows(self, q: SX) -> list[ValidityRow]:
        """Return the validity conditions on the inputs `asked`; empty if there are none.

        Args:
            q: (nq, 1) symbols. The parameters are those of the system.
        """
        asked, check = self.asked(), self._check_configuration
        if not asked:
            return []
        of = {"parameter": "p"}
        rows = [row for row in plain_rows(self._system, q) if of.get(row.kind, "q") in asked]
        return [*rows, *(check.rows(self._system, q) if check and "q" in asked else [])]

    def valid(self) -> Function | None:
        """Return the Function ``valid(q, p)``, 1 if all columns of q and p are valid, else 0.

        Returns:
            Function of the inputs `asked`. None if the model requires finite numbers only.
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
        """Return the Function `valid` for one column; None if there are no conditions."""
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
        """Return ``state(..) -> valid, delicate`` of a column; common parts are evaluated once."""
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
        """Return the default parameters p; None if a parameter has no value."""
        try:
            return np.array(self._system.parameter_values(), dtype=float)
        except ModelError:
            return None

    def rewritten(self, function: Function) -> ModelFunction:
        """Return a copy with an equivalent Function; the named intermediate quantities are kept.

        Args:
            function: Function with the same inputs, outputs and values.
        """
        made = self.like(function)
        if self._annotate is not None:
            made._annotate = lambda: names_found(Function(function), self.annotated())
        return made

    def map(self, *args: Any) -> Function:
        """Return the model over many columns; arguments as `casadi.Function.map`."""
        return self.like(Function.map(self, *args))

    def expand(self, *args: Any) -> Function:
        """Return the model as scalar (SX) operations; arguments as `casadi.Function.expand`."""
        return self.like(Function.expand(self, *args))

    def elements(self, name: str) -> list[tuple[str, str]]:
        """Return (name, unit) of every element of an input or output; empty if they have no names.

        Args:
            name: name of the input or output.
        """
        return _elements(self._system).get(name, [])

    def describe(self) -> str:
        """Return a table of index, name, quantity and unit of every input and output element."""
        return function_table(self)

    def __str__(self) -> str:
        """Return the table of `describe`; `repr` is the one line of CasADi."""
        return self.describe()

    def example(self, name: str) -> NDArray[np.float64] | None:
        """Return a valid value of an input with conditions; None if any number is valid.

        Args:
            name: name of the input.
        """
        return self.default_of_p() if name == "p" else None

    @property
    def _title(self) -> str:
        """Name of the Function and of its system, for error messages."""
        return f"{self.name()}({self._system.name})"

    def _given(self, args: tuple[Any, ...], kwargs: dict[str, Any]) -> dict[str, Any]:
        """Return every input by name, with the default of p.

        Raises ModelError for a missing, unknown or repeated input.

        `args` and `kwargs` are the arguments of a call.
        """
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
        """Return an input as CasADi accepts it: finite numbers of the right size, or symbols.

        Raises ModelError for any other value.

        `name` is the name of the input.
        """
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
            # the sum of squares is the fastest test, but may overflow for large numbers
            finite = (line and math.isfinite(array.dot(array))) or bool(np.isfinite(array).all())
            checked = self._asks and name in ("q", "p")
            value = array if line and not checked else _dm(array)
        if not finite:
            raise ModelError(f"{self._title}: {name} is not finite; give numbers")
        return value

    def _check_size(self, name: str, shape: tuple[int, ...], value: Any) -> None:
        """Raise ModelError if the shape of an input does not fit; `value` is the input itself."""
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
        """Raise ModelError for invalid numbers; return whether outputs are to be verified.

        `inputs` are the values by name. Outputs are verified if the configuration is nearly
        singular.
        """
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
        """Raise ModelError with the violated condition of one column of inputs, given by name."""
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
        """Raise an error if the configuration check finds numeric outputs inaccurate.

        `inputs` and `outputs` are the values of one evaluation.
        """
        check = self._check_configuration
        every = outputs if isinstance(outputs, tuple) else (outputs,)
        if check is None or check.verify is None or not all(isinstance(o, DM) for o in every):
            return

        def evaluate(values: Mapping[str, DM]) -> list[DM]:
            return list(Function.call(self, [*values.values()]))

        check.verify(self._system, self.name_out(), evaluate, inputs, every)

    def _require_numbers(self, outputs: Any) -> None:
        """Raise ModelError if a numeric output is NaN, except the outputs in `may_be_nan`."""
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
        """Return names and sizes of the inputs as text for error messages."""
        sizes = (f"{name} {self.size_in(name)}" for name in self.name_in())
        return ", ".join(sizes)


def _dm(array: NDArray[np.float64]) -> DM:
    """Return an array as DM. With a sparsity pattern, CasADi converts it in half the time."""
    rows, columns = (*array.shape, 1, 1)[:2]
    return DM(Sparsity.dense(rows, columns), array.ravel(order="F"))


def _columns(value: DM | SX | MX | None, rows: int) -> NDArray[np.float64] | None:
    """Return the columns (rows, n) of an input; None if it is symbolic or has another size.

    `value` is the input.
    """
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
    """Return the model of a pickle made by `ModelFunction.__reduce__`."""
    return ModelFunction(Function.deserialize(data), system, check=check, loops=loops)


def model_function(
    system: System,
    key: tuple[Any, ...],
    build: Callable[[], tuple[Named, Named] | tuple[Named, Named, Named]],
    check: ConfigurationCheck | None = None,
    loops: Any = None,
) -> Function:
    """Return the model of a system for a key, built at the first request.

    Args:
        system: system of the model, whose cache stores the Function.
        key: name of the Function, then data that distinguish it from others of the same name.
        build: callable that returns the named inputs and outputs in CasADi symbols and, optionally,
            named intermediate scalars. The parameters of the system, if any, become the last
            input p.
        check: validity conditions on numeric positions q.
        loops: source of code that loops over the links, for `mbs.native.compiled`.

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
    """Return the component states z and inputs u that outputs need and that are no inputs yet.

    Args:
        system: system with the components.
        inputs: named inputs of a model.
        outputs: named outputs of the model.
    """
    given = {name for name, _ in inputs}
    found = [("z", system.component_states), ("u", system.u)]
    needed = casadi.veccat(*(value for _, value in outputs))
    return [
        (name, symbols)
        for name, symbols in found
        if name not in given and symbols.numel() and casadi.depends_on(needed, symbols)
    ]


def default_in(system: System, others: int) -> list[float]:
    """Return the default inputs for CasADi, which have one number per input.

    It is 0, and for p the value that all parameters have in common, or NaN.

    Args:
        system: system of the model.
        others: number of inputs before p.
    """
    if not system.parameters:
        return [0.0] * others
    values = set(system.p_default)
    return [0.0] * others + [values.pop() if len(values) == 1 else float("nan")]


def require_system(system: object) -> None:
    """Raise if the argument is not a System, such as a mechanism that was not assembled.

    Args:
        system: any object.

    Raises:
        ModelError: the argument is no System. The message has the required call.
    """
    if not isinstance(system, System):
        name = getattr(system, "name", None)
        what = f"{name if isinstance(name, str) else quoted(system)} ({type(system).__name__})"
        assembles = hasattr(system, "assemble")
        remedy = "call assemble() first" if assembles else "give what assemble() returns"
        raise ModelError(f"{what} is not a System, of which models are made; {remedy}")


def _elements(system: System) -> dict[str, list[tuple[str, str]]]:
    """Return lists of (name, unit) of elements, by the name of each input or output of models."""
    q = [(coordinate.name, coordinate.unit) for coordinate in system.coordinates]
    free = [system.velocity_coordinates[k] for k in system.chosen_coordinates]
    units = {"v": _SAME_UNIT, "a": ACCELERATION_UNIT, "tau": EFFORT_UNIT}
    result = {"q": q, "p": [(parameter.name, parameter.unit) for parameter in system.parameters]}
    result["q_a"] = [(speed.name, speed.unit.removesuffix("/s")) for speed in free]
    for name, unit in units.items():
        every = [(speed.name, unit[speed.unit]) for speed in system.velocity_coordinates]
        result[name] = every
        result[f"{name}_a"] = [every[k] for k in system.independent]
    result["tau_m"] = [result["tau"][k] for k in system.motors]
    result |= {"z": list(system.states), "u": list(system.inputs), "y": list(system.outputs)}
    return result
