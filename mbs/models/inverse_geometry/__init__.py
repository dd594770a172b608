"""Inverse geometric models (inverse kinematics): configurations of a robot for poses of a frame.

All functions use one pipeline of four stages:

1. Draft: candidates of a closed form, the general method or a search. `draft` computes one pose by
   any method, `draft_compiled` one regular pose by compiled code, `draft_many` many poses at once.
2. Polish: Newton's method from the candidates, `mbs.closed_forms.arm_search.polish` in the run-time
   library. A draft is certain if no solution can be missing or be present twice. A certain draft is
   answered directly.
3. Verify: `verify` merges copies, finds multiplicities and self-motions, and marks what double
   precision cannot decide. Drafts near singular configurations are completed by further methods.
4. Answer: `answer` completes solutions of a chain to configurations of the robot (`whole_robot`
   closes its loops), names the branches, applies the limits, or states why there is no solution.

`solve` runs all stages for one pose. `solver` and `solve_many` return certain drafts and send all
other poses to `solve`. `follow` continues one solution along a path, and takes solutions of other
branches from the same stages. Assembly modes of loops have the same stages in `mbs.loops`: closed
forms or elimination, Newton's method on all closure rows, closure and isolation, `ModeList`.

Solutions are passed in five types, defined in `solutions` and `_follow`: `PoseDraft` (one pose of a
chain; a `PoseAnswer` is the draft of a whole robot), `Solution` (one verified configuration),
`Solutions` (answer of one pose), `ManySolutions` (draft and answer of many poses) and `Followed`
(answer of a path). `Family` and `Nearest` describe parts of an answer.
"""

from mbs.closed_forms.arm_search import Nearest
from mbs.models.inverse_geometry._follow import Followed, follow
from mbs.models.inverse_geometry._free_orientation import FreeOrientation, free_orientation
from mbs.models.inverse_geometry._solve import solve
from mbs.models.inverse_geometry._solve_many import solve_many
from mbs.models.inverse_geometry._solver import PoseAnswer, PoseSolver, solver
from mbs.models.inverse_geometry.functions import InverseGeometry, function
from mbs.models.inverse_geometry.listing import text
from mbs.models.inverse_geometry.self_motions import Family
from mbs.models.inverse_geometry.solutions import ManySolutions, Solution, Solutions

__all__ = [
    "Family",
    "Followed",
    "FreeOrientation",
    "InverseGeometry",
    "ManySolutions",
    "Nearest",
    "PoseAnswer",
    "PoseSolver",
    "Solution",
    "Solutions",
    "follow",
    "free_orientation",
    "function",
    "solve",
    "solve_many",
    "solver",
    "text",
]
