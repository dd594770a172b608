"""A search by IPOPT that tells how far it has come."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi
from casadi import DM, MX, SX, Sparsity

Watch = Callable[[float], None]
"""Is told the part of a long work that is over, between 0 and 1."""

_OUTPUTS = ("x", "f", "g", "lam_x", "lam_g", "lam_p")


class SolverFollower(casadi.Callback):
    """Called by the solver after every step; it must be kept as long as the solver."""

    def __init__(
        self, programme: Mapping[str, SX | MX], most: int, watch: Watch | None = None
    ) -> None:
        casadi.Callback.__init__(self)
        self._sizes = [programme[name].numel() for name in "xfg"]
        self._most = most
        self._watch = watch
        self._steps = 0
        self.construct("follower", {})

    @property
    def options(self) -> dict[str, Any]:
        """What the solver has to know; nothing where nobody watches."""
        return {} if self._watch is None else {"iteration_callback": self}

    def get_n_in(self) -> int:
        """What the solver gives after a step."""
        return len(_OUTPUTS)

    def get_n_out(self) -> int:
        """Whether it is to stop."""
        return 1

    def get_name_in(self, k: int) -> str:
        """As the solver calls its outputs."""
        return _OUTPUTS[k]

    def get_sparsity_in(self, k: int) -> Sparsity:
        """Columns; there are no parameters."""
        x, f, g = self._sizes
        return Sparsity.dense((x, f, g, x, g, 0)[k], 1 if k < 5 else 0)

    def eval(self, _: Sequence[DM]) -> list[int]:
        """Never stops the solver."""
        self._steps += 1
        if self._watch is not None:
            self._watch(min(self._steps / self._most, 1.0))
        return [0]
