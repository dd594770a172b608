"""The exception tree: every error that mbs raises on purpose.

    MbsError
    ├── DescriptionError      a component or a file says something impossible
    │   ├── ArgumentError     a component has no such argument, or needs another one
    │   └── ExpressionError   a text is not a number or an expression of symbols
    ├── AssemblyError         the components do not form a mechanism
    ├── LoopError             a closed loop has no usable configuration
    │   ├── NoClosedForm      a loop is solved by iteration only
    │   ├── SingularPosture   the independent joints cannot lead the others there
    │   └── Unclosable        no configuration closes the loop
    ├── ModelError            a model was asked for that the system does not have
    ├── SolverError           a numerical method could not go on
    ├── CompilerError         no compiler, or the compiler refused the code
    └── ExportError           a file could not be written

A message is one sentence: which component, what value, which rule, what to do.

`Interrupted` stands apart: a KeyboardInterrupt is no error, and `except Exception` lets it by.
"""

from collections.abc import Callable, Sequence
from typing import Any


class MbsError(Exception):
    """Base of all errors raised on purpose by mbs."""


class DescriptionError(MbsError, ValueError):
    """A component or a robot file describes something impossible."""


class ArgumentError(DescriptionError, TypeError):
    """A component is made with an argument that it does not have, or without one that it needs."""


class ExpressionError(DescriptionError):
    """A text is neither a number nor an expression of symbols."""


class AssemblyError(MbsError, ValueError):
    """The components do not form a mechanism."""


class LoopError(MbsError):
    """A closed loop has no usable configuration."""


class SingularPosture(LoopError):
    """A configuration at which the independent joints do not determine how the others move."""


class NoClosedForm(LoopError):
    """A loop whose passive joints no closed form known here gives."""


class Unclosable(LoopError):
    """No configuration closes the loops of the mechanism."""


class ModelError(MbsError, ValueError):
    """A model was asked for that the system does not have."""


class SolverError(MbsError, RuntimeError):
    """A numerical method could not go on.

    Attributes:
        state: the last state that an integration reached; empty where there is none.
        singular: whether it stopped at a singular configuration.
        time: at which a motion stopped, s; None where there is no motion.
        fired: numbers of the event indicators that are to blame; empty where none is.
        result: what a simulation had reached, a `Result`; None where it is not one that stopped.
    """

    def __init__(
        self,
        *args: object,
        state: Sequence[float] = (),
        singular: bool = False,
        time: float | None = None,
        fired: Sequence[int] = (),
    ) -> None:
        """As of every exception, with what is known of where it happened."""
        super().__init__(*args)
        self.state = tuple(state)
        self.singular = singular
        self.time = time
        self.fired = tuple(fired)
        self.result: Any = None


class Interrupted(KeyboardInterrupt):
    """A run was interrupted by control-C; its result is the part that is complete.

    Attributes:
        time: at which a motion stopped, s; None where it is not a motion.
        compute: makes the result of a motion, which may take as long as its laws.
    """

    def __init__(self, *args: object, time: float | None = None) -> None:
        """As of every exception, with the time."""
        super().__init__(*args)
        self.time = time
        self.compute: Callable[[], Any] | None = None
        self._result: Any = None

    @property
    def result(self) -> Any:
        """The `Result` of a simulation or the `Sweep` of a study; made when it is first read."""
        if self._result is None and self.compute is not None:
            self._result, self.compute = self.compute(), None
        return self._result

    @result.setter
    def result(self, value: Any) -> None:
        self._result = value


class CompilerError(MbsError, RuntimeError):
    """No C compiler was found, or it refused the code."""


class ExportError(MbsError, OSError):
    """A file could not be written."""
