/* Inputs within a communication step: Taylor polynomials in time about its start. */
#include "internal.h"

#include <math.h>
#include <string.h>

static double *slopes(core *c, int order) { return c->m.slopes + (order - 1) * NU; }

/* Derivative of order `first` (0: value) of an input, `after` seconds after the step began. */
static double extrapolated(core *c, int input, int first, double after) {
    double sum = 0.0;
    int order;
    for (order = INPUT_ORDERS; order > first; order--)
        sum = (sum + slopes(c, order)[input]) * after / (order - first);
    return sum + (first ? slopes(c, first)[input] : c->m.values[INPUTS + input]);
}

const double *core_inputs(core *c, double t) {
    int i;
    if (c->m.inputs != INPUTS_MOVE) return c->m.values + INPUTS;
    for (i = 0; i < NU; i++) c->u[i] = extrapolated(c, i, 0, t - c->m.input_time);
    return c->u;
}

void core_input_rates(core *c, double t, double *du) {
    int i;
    for (i = 0; i < NU; i++)
        du[i] = c->m.inputs == INPUTS_HELD ? 0.0 : extrapolated(c, i, 1, t - c->m.input_time);
}

static void hold(core *c) {
    c->m.inputs = INPUTS_HELD;
    memset(c->m.slopes, 0, sizeof c->m.slopes);
}

void core_begin_inputs(core *c) {
    if (c->m.inputs != INPUTS_MOVED) return;
    hold(c);
    core_restart(c);
}

void core_end_inputs(core *c) {
    double after = c->m.time - c->m.input_time;
    int i, order;
    if (c->m.inputs != INPUTS_MOVE) return;
    for (i = 0; i < NU; i++) {
        c->m.values[INPUTS + i] = extrapolated(c, i, 0, after);
        for (order = 1; order <= INPUT_ORDERS; order++)
            slopes(c, order)[i] = extrapolated(c, i, order, after);
    }
    c->m.input_time = c->m.time;
    c->m.inputs = INPUTS_MOVED;
}

static core_status settable_slope(core *c, core_reference ref, int order, double value) {
    if (ref < INPUTS || ref >= OUTPUTS)
        return core_refuse(c, "%s: value reference %u is no input; only inputs are interpolated",
                           c->name, (unsigned)ref);
    if (order < 1 || order > INPUT_ORDERS)
        return core_refuse(c, "%s: derivative %d of %s is not followed; use orders 1 to %d",
                           c->name, order, MODEL_NAMES[ref], INPUT_ORDERS);
    if (!isfinite(value))
        return core_refuse(c, "%s: derivative %d of %s = %g is not finite", c->name, order,
                           MODEL_NAMES[ref], value);
    return CORE_OK;
}

core_status core_set_input_slopes(core *c, const core_reference *ref, size_t n, const core_integer *order,
                                  const double *values) {
    size_t i;
    if (!core_allowed(c, c->m.cosimulation ? INITIALIZATION | STEP : 0,
                      "setting derivatives of inputs"))
        return CORE_ERROR;
    if (n && (!ref || !order || !values))
        return core_refuse(c, "%s: the array is NULL", c->name);
    for (i = 0; i < n; i++)
        if (settable_slope(c, ref[i], (int)order[i], values[i])) return CORE_ERROR;
    if (!n) return CORE_OK;
    if (c->m.inputs == INPUTS_MOVED) hold(c);
    for (i = 0; i < n; i++) slopes(c, (int)order[i])[ref[i] - INPUTS] = values[i];
    c->m.inputs = INPUTS_MOVE;
    c->m.input_time = c->m.time;
    core_restart(c);
    return CORE_OK;
}
