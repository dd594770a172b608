"""Where the C code of a Function has its inputs, outputs and work space."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate

from casadi import Function

from mbs.native.schedule import LANES
from mbs.operations.graph import Graph


@dataclass(frozen=True, slots=True)
class Memory:
    """The work space: slots, what callers do not want, then what maps take and give.

    Attributes:
        function: the whole Function.
        graph: the scalar operations of it; it has more inputs and outputs where there are maps.
        slots: doubles that its blocks leave for each other.
    """

    function: Function
    graph: Graph
    slots: int

    @property
    def size(self) -> int:
        """Doubles in all."""
        return self.slots + self._lost + (self._starts[-1] + LANES if self._sizes else 0)

    def buffer(self, number: int) -> int:
        """The number in `out` of an input of the graph that a map gives."""
        return len(self.graph.outputs) + number - self.function.n_in()

    def pointers(self) -> list[str]:
        """Lines that declare `in` and `out`.

        What a caller left out is replaced: inputs are zero, outputs are lost. `out` has the
        outputs of the graph, then those of the maps, which are also the last of `in`.
        """
        n_in, n_out = self.function.n_in(), self.function.n_out()
        most = max((port.sparsity.nnz() for port in self.graph.inputs[:n_in]), default=0)
        places = [f"base + {start}" for start in self._starts[:-1]]
        taken = len(self.graph.outputs) - n_out
        inputs = [f"arg[{k}] ? arg[{k}] : zeros" for k in range(n_in)] + places[taken:]
        outputs = [f"res[{k}] ? res[{k}] : w + {self.slots}" for k in range(n_out)] + places
        base = f"  double *const base = mbs_aligned(w + {self.slots + self._lost});"
        lanes = f"  mbs_lanes *const lanes = (mbs_lanes *)(base + {self._starts[-1]});"
        return [
            f"  static const double zeros[{most or 1}];",
            *([base, lanes] if self._sizes else []),
            f"  const double *const in[] = {{{', '.join(inputs) or '0'}}};",
            f"  double *const out[] = {{{', '.join(outputs) or '0'}}};",
        ]

    @property
    def _lost(self) -> int:
        return max((self.function.nnz_out(k) for k in range(self.function.n_out())), default=0)

    @property
    def _sizes(self) -> list[int]:
        """Of what maps take, then of what they give."""
        taken = self.graph.outputs[self.function.n_out() :]
        given = self.graph.inputs[self.function.n_in() :]
        return [port.sparsity.nnz() for port in (*taken, *given)]

    @property
    def _starts(self) -> list[int]:
        rounded = ((size + LANES - 1) // LANES * LANES for size in self._sizes)
        return list(accumulate(rounded, initial=0))
