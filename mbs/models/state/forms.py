"""State equations of a system in both forms of the state, with the same inputs and outputs."""

from __future__ import annotations

from dataclasses import dataclass

from mbs.assembly import System
from mbs.models.state.drive import DriveInputs
from mbs.models.state.equations import Observe
from mbs.models.state.independent import MinimalState, independent_state
from mbs.models.state.layout import state_inputs
from mbs.models.state.tree import TreeState, tree_state


@dataclass(frozen=True, slots=True, eq=False)
class StateEquations:
    """State equations of a system whose inputs are arguments, in two forms.

    Both have the same inputs and outputs, events and laws, from one set of equations of motion.
    `full_state` returns the second form for a simulation, in which the inputs are laws.

    Attributes:
        independent: equation of the independent joints. Its states can be set freely, as Model
            Exchange requires.
        tree: equation of all joints, whose steps are projected onto the constraints and can pass
            singular configurations, for Co-Simulation. None if `tree_state` has no result, or if it
            is not wanted.
    """

    independent: MinimalState
    tree: TreeState | None


def state_equations(
    system: System,
    observe: Observe | None = None,
    drive: DriveInputs | None = None,
    *,
    crossings: bool = False,
    tree: bool = True,
    events: bool = True,
) -> StateEquations:
    """Return the state equations of a system.

    Args:
        system: open or closed system.
        observe: function that returns additional outputs at the end of y.
        drive: additional inputs, and control laws that replace the efforts of motors or the inputs
            of components.
        crossings: whether events end steps at discontinuities of laws.
        tree: whether to return the equation of all joints.
        events: whether the steps of the equation of all joints end at events. If not, a system with
            events has none.

    Raises:
        ModelError: as in `minimal_state`.
    """
    inputs = state_inputs(system, drive)
    independent = independent_state(inputs, observe, crossings=crossings)
    if not tree or (independent.events is not None and not events):
        return StateEquations(independent, None)
    return StateEquations(independent, tree_state(inputs, observe, crossings=crossings))
