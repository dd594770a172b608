"""Modules that the process from which jobs are forked imports in advance."""

import mbs.export.languages.build  # imports sympy, which would take one second of each job
import mbs.identification
import mbs.loops
import mbs.models
import mbs.robots
import mbs.simulate  # noqa: F401
