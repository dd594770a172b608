"""The general inverse geometric model of six joints, by elimination.

`prepare` chooses once for each arm:

1. The arrangement of the loop. The target pose closes the arm to a loop Z_1 C_1 .. Z_6 C_6 = 1. It
   may begin at any joint whose predecessor is revolute, and run in either direction.
2. The elimination: the equations that are used, and the half angle that multiplies them, x4 or x5.
3. The pencil: the matrix whose determinant vanishes at a solution. The choice whose matrix is
   farthest from singular is kept. It depends on the arm alone.

The run-time library (`core/source/raghavan_roth.h`) solves for a pose. Lengths are divided by the
length of the loop:

1. `roth_transforms`: the six constant transforms of the loop, one of which contains the pose.
2. `roth_eliminate`: the parts of the matrix of joint 3, from the left null rows of the factors of
   joints 1 and 2.
3. `roth_roots`: eigenvalues of a companion matrix, with an offset of joint 3 at which the matrix at
   infinity is well conditioned. Roots near the unit circle are kept, in clusters.
4. `roth_middle`: the null space of the matrix at a root has the dimension of the cluster. Joints 4
   and 5 follow from its shifts.
5. `roth_rest`: joint 2 from linear equations with one root or two, then joints 1 and 6.
6. `roth_solve` polishes the candidates and checks them by the direct geometric model.

Configurations that share a root, or are nearly double, are all found.

`characteristic` is the same matrix in expressions of the pose, for users.

Source: Raghavan and Roth 1993; Manocha and Canny 1994.
"""

from mbs.closed_forms.raghavan_roth.expressions import (
    Characteristic,
    characteristic,
)
from mbs.closed_forms.raghavan_roth.numbers import Prepared, prepare

__all__ = [
    "Characteristic",
    "Prepared",
    "characteristic",
    "prepare",
]
