"""Exceptions: every error that mbs raises on purpose.

    MbsError
    ├── DescriptionError      a component or a file describes something impossible
    │   ├── ArgumentError     a component has an unknown or a missing argument
    │   └── ExpressionError   a text is not a number or an expression of symbols
    ├── AssemblyError         the components do not form a mechanism
    ├── LoopError             a closed loop has no usable configuration
    │   ├── NoClosedForm      a loop has no closed form and requires iteration
    │   ├── SingularPosture   the independent joints do not determine the dependent joints
    │   └── Unclosable        no configuration closes the loop
    ├── ModelError            a model does not exist for the system, or a call is invalid
    ├── SolverError           a numerical method failed
    ├── CompilerError         no compiler was found, or the code does not compile
    └── ExportError           a file could not be written

A message is a single sentence: the component, the value, the violated rule and the remedy.

`Interrupted` is no MbsError: it is a KeyboardInterrupt, which `except Exception` does not catch.
"""

from collections.abc import Callable, Sequence
from typing import Any


class MbsError(Exception):
    """Base class of all errors raised on purpose by mbs."""


class DescriptionError(MbsError, ValueError):
    """A component or a robot file describes something impossible."""


class ArgumentError(DescriptionError, TypeError):
    """The constructor of a component has an unknown argument, or a required one is missing."""


class ExpressionError(DescriptionError):
    """A text is neither a number nor an expression of symbols."""


class AssemblyError(MbsError, ValueError):
    """The components do not form a mechanism."""


class LoopError(MbsError):
    """A closed loop has no usable configuration."""


class SingularPosture(LoopError):
    """A configuration at which the independent joints do not determine the dependent joints."""


class NoClosedForm(LoopError):
    """A loop has no known closed form of its passive joints."""


class Unclosable(LoopError):
    """No configuration closes the loops of the mechanism."""


class ModelError(MbsError, ValueError):
    """A model does not exist for the system, or a call of mbs has invalid arguments."""


class SolverError(MbsError, RuntimeError):
    """A numerical method failed.

    Attributes:
        state: last state that an integration reached. Empty without an integration.
        singular: Whether the method stopped at a singular configuration.
        time: time at which a motion stopped [s]. None without a motion.
        fired: indices of the event indicators that caused the failure. Empty if no event did.
        result: `Result` of a simulation until it stopped. None for other methods.
    """

    def __init__(
        self,
        *args: object,
        state: Sequence[float] = (),
        singular: bool = False,
        time: float | None = None,
        fired: Sequence[int] = (),
    ) -> None:
        """Create the exception with a message and the data of the failure."""
        super().__init__(*args)
        self.state = tuple(state)
        self.singular = singular
        self.time = time
        self.fired = tuple(fired)
        self.result: Any = None


class Interrupted(KeyboardInterrupt):
    """A run was interrupted by control-C. Its result contains the completed part.

    Attributes:
        time: time at which a motion stopped [s]. None without a motion.
        compute: function that returns the result of a motion. Evaluating all its outputs may take
            long.
    """

    def __init__(self, *args: object, time: float | None = None) -> None:
        """Create the exception with a message and the time of the interruption."""
        super().__init__(*args)
        self.time = time
        self.compute: Callable[[], Any] | None = None
        self._result: Any = None

    @property
    def result(self) -> Any:
        """`Result` of a simulation or `Sweep` of a parameter sweep; computed on first access."""
        if self._result is None and self.compute is not None:
            self._result, self.compute = self.compute(), None
        return self._result

    @result.setter
    def result(self, value: Any) -> None:
        """Set the `Result` or `Sweep` to return instead of that of `compute`."""
        self._result = value


class CompilerError(MbsError, RuntimeError):
    """No C compiler was found, or the code does not compile."""


class ExportError(MbsError, OSError):
    """A file could not be written."""
