"""What the server that children are forked from loads in advance."""

import mbs.export.languages.build  # with sympy, a second of every text
import mbs.identification
import mbs.loops
import mbs.models
import mbs.robots
import mbs.simulate  # noqa: F401
