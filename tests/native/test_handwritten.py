"""C written by hand behind a Function goes along with C of its callers."""

import casadi
import numpy as np
from casadi import SX, Function

from mbs.native import c_source, cached_library, compiled
from mbs.native._compiled import calls_machine_code
from mbs.native.handwritten import handwritten, handwritten_text, names_declared

COMMON = {
    "twice.h": "#ifndef TWICE_H\n#define TWICE_H\nenum { HALF_AGAIN = 3 };\n"
    "double twice(double x);\n#endif\n",
    "twice.c": '#include "twice.h"\n\n#define FACTOR 2.0\ndouble twice(double x)'
    " { return FACTOR * x; }\n",
}


def doubled(plus):
    own = f"""#include <math.h>
#include "twice.h"
static const double FUNCTION_plus[] = {{{plus}}};
EXPORT int FUNCTION(const double **arg, double **res, long long *iw, double *w, int mem) {{
    (void)iw; (void)w; (void)mem;
    res[0][0] = twice(arg[0][0]) + FUNCTION_plus[0];
    return 0;
}}
EXPORT int jac_FUNCTION(const double **arg, double **res, long long *iw, double *w, int mem) {{
    (void)arg; (void)iw; (void)w; (void)mem;
    if (res[0]) res[0][0] = 2.0;
    return 0;
}}
"""
    x, y = SX.sym("x"), SX.sym("y")
    names = ["x"], ["y"]
    signature = Function("doubled", [x], [SX(1)], *names)
    slope = Function("jac_doubled", [x, y], [SX(1)], ["x", "out_y"], ["jac_y_x"])
    return handwritten(signature, slope, own, COMMON, 1)


def test_two_functions_share_one_runtime():
    one, other = doubled(1.0), doubled(5.0)
    assert one.name() != other.name()
    x = casadi.MX.sym("x")
    both = Function("both", [x], [one(x) + other(x) ** 2])
    assert both(3.0) == 7.0 + 121.0
    assert both.jacobian()(3.0, 0) == 2.0 + 2 * 11.0 * 2.0
    assert not calls_machine_code([both])
    text = handwritten_text([both, one])
    assert text.count("return FACTOR * x;") == 1
    assert text.endswith("#undef EXPORT\n#undef FACTOR\n#undef INTERNAL\n")
    assert {"twice", "HALF_AGAIN", one.name()} <= names_declared(text)
    library = cached_library({"both.c": c_source(both)})
    assert casadi.external("both", str(library))(3.0) == 128.0
    assert np.array_equal(compiled(both)(3.0), [128.0])


def test_others_have_no_text():
    x = SX.sym("x")
    assert handwritten_text([Function("plain", [x], [x])]) == ""
