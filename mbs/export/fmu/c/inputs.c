#include "inputs.h"

#include <string.h>

/* Derivatives (NU,) of one order. */
static const double *slopes(const core_inputs *in, int order) {
    return in->slopes + (order - 1) * NU;
}

/* Derivative of order `first` (0: value) of an input, `after` seconds after the step began. */
static double extrapolated(const core_inputs *in, const double *given, int input, int first,
                           double after) {
    double sum = 0.0;
    int order;
    for (order = INPUT_ORDERS; order > first; order--)
        sum = (sum + slopes(in, order)[input]) * after / (order - first);
    return sum + (first ? slopes(in, first)[input] : given[input]);
}

const double *inputs_at(const core_inputs *in, const double *given, double t, double *u) {
    int i;
    if (in->motion != INPUTS_MOVE) return given;
    for (i = 0; i < NU; i++) u[i] = extrapolated(in, given, i, 0, t - in->time);
    return u;
}

void inputs_rates(const core_inputs *in, const double *given, double t, double *du) {
    int i;
    for (i = 0; i < NU; i++)
        du[i] = in->motion == INPUTS_HELD ? 0.0 : extrapolated(in, given, i, 1, t - in->time);
}

void inputs_hold(core_inputs *in) {
    in->motion = INPUTS_HELD;
    memset(in->slopes, 0, sizeof in->slopes);
}

void inputs_set_slope(core_inputs *in, int input, int order, double value, double t) {
    in->slopes[(order - 1) * NU + input] = value;
    in->motion = INPUTS_MOVE;
    in->time = t;
}

void inputs_end_step(core_inputs *in, double *given, double t) {
    double after = t - in->time;
    int i, order;
    if (in->motion != INPUTS_MOVE) return;
    for (i = 0; i < NU; i++) {
        given[i] = extrapolated(in, given, i, 0, after);
        for (order = 1; order <= INPUT_ORDERS; order++)
            in->slopes[(order - 1) * NU + i] = extrapolated(in, given, i, order, after);
    }
    in->time = t;
    in->motion = INPUTS_MOVED;
}
