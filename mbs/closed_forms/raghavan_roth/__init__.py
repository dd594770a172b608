"""The general inverse geometric model of six joints, by elimination.

Once for each arm, `prepare`:

1. `arrangement`: the target pose closes the arm to a loop Z_1 C_1 .. Z_6 C_6 = 1, which may begin
   at any joint whose predecessor turns, and run either way.
2. `elimination`: which equations, and whether x4 or x5 multiplies them.
3. `pencil`: the choice whose matrix is farthest from singular is kept; it depends on the arm alone.

For each pose, `candidates`, in units of the loop's length:

1. `Arrangement.all_ways`: the six ways C of the loop, one of them with the pose.
2. `Pencil.matrices`: the parts M_k of the matrix of joint 3, from the left null rows of what
   joints 1 and 2 are in.
3. `roots`: eigenvalues of a companion matrix, with the offset of joint 3, of eight, at which the
   matrix at infinity is best conditioned (compiled: the first at which it is well conditioned);
   roots near the unit circle are kept, in clusters.
4. `middle`: the null space of the matrix at a root, as large as the cluster; joints 4 and 5 from
   its shifts.
5. `rest`: joint 2 from linear equations, one root or two, then joints 1 and 6.
6. `Arrangement.configurations`: back to the joints of the arm.

What comes out is to be polished and checked by the direct model. No configuration is lost at a
root that several configurations share, and near double ones neither.

`characteristic` is the same matrix in expressions of the pose, for users.

Source: Raghavan & Roth 1993; Manocha & Canny 1994.
"""

from mbs.closed_forms.raghavan_roth.expressions import (
    Characteristic,
    characteristic,
)
from mbs.closed_forms.raghavan_roth.numbers import Prepared, candidates, candidates_many, prepare

__all__ = [
    "Characteristic",
    "Prepared",
    "candidates",
    "candidates_many",
    "characteristic",
    "prepare",
]
