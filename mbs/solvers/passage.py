"""What a motion with constraints that become dependent in single states is integrated with."""

from dataclasses import dataclass

import casadi


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """Functions of t, x = [q; v; z] and p, for steps in local tangent coordinates.

    `native/runtime/passage.h` tells what is done with them.

    Attributes:
        rows: `rows(t, x, p) -> place, slope, J, b, c, N, bend, rank`: rows of positions and their
            slopes by q; rows of velocities with J v = b and J a = c; q' = N v and q'' = N a + bend;
            the rank of J.
        forces: `forces(t, x, p) -> M, f, rate`: M a = f + J' y, and the rates of z.
        regularity: `regularity(t, x, p)`, near zero and linear in the distance from where rows
            become dependent.
        size: nq, nv and nz; the number of rows of positions, of those that hold a coordinate
            wherever it is, and of rows of velocities; 1 where rows depend on time.
        typical: regularity at a common configuration.
    """

    rows: casadi.Function
    forces: casadi.Function
    regularity: casadi.Function
    size: tuple[int, int, int, int, int, int, int]
    typical: float
