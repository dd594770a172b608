#include "calculated.h"

#include <math.h>
#include <string.h>

#include "charts.h"
#include "configuration.h"
#include "tree_state.h"

#ifdef MODEL_TREE
#include "passage_start.h"
#endif

/* Compute the positions of cut joints, check that all calculated values are finite, and mark them as
 * up to date. */
static core_status check_values(machine *m) {
    double *v = m->values;
    int i;
#if NCUT > 0
    machine_loop_point(m, v + STATES, v + DEPENDENTS);
    m->res[0] = v + CUTS;
    if (machine_call(m, mbs_cuts))
        return log_failed(m->log, "the cut joints have no positions at time %.9g", m->run->time);
#endif
    for (i = 0; i < INDICATORS; i++) /* event indicators are checked when they are read */
        if (!isfinite(v[i]))
            return log_failed(m->log,
                              "%s is not finite at time %.9g; look for a singular "
                              "configuration or a zero mass",
                              MODEL_NAMES[i], m->run->time);
    m->variables->stale = 0;
    return CORE_OK;
}

/* The same check if the joint coordinates are the states for the external integrator. */
static core_status check_joint_values(machine *m) {
    double *v = m->values;
    memcpy(v + CHART_STATES, v + STATES, NS * sizeof *v);
    memcpy(v + CHART_RATES, v + DERIVATIVES, NS * sizeof *v);
    return check_values(m);
}

#ifdef MODEL_TREE

/* Calculate all values from the state of the tree. */
static core_status by_tree(core_solver *s) {
    machine *m = s->machine;
    double slope[NT], *v = m->values;
    int i;
    tree_show(s);
    if (tree_call(s, s->tree->X, slope, v + OUTPUTS)) return machine_unsolved(m);
    for (i = 0; i < NX; i++) v[DERIVATIVES + i] = slope[MODEL_TREE_STATES[i]];
    return check_joint_values(m);
}

/* Calculate all values at a start in a singular configuration. The accelerations belong to the
 * branch of the start velocities and come from configurations on both sides. */
static core_status at_singular_start(core_solver *s) {
    machine *m = s->machine;
    double none[NT], *v = m->values;
    int i;
    tree_show(s);
    if (passage_slope(s->passage, m->run->time, s->tree->X, s->tree->slope, NULL) ||
        tree_call(s, s->tree->X, none, v + OUTPUTS))
        return machine_unsolved(m);
    tree_show_slope(s->tree->slope, v + OUTPUTS);
    for (i = 0; i < NX; i++) v[DERIVATIVES + i] = s->tree->slope[MODEL_TREE_STATES[i]];
    return check_joint_values(m);
}

/* Calculate all values after the start, for an instance that integrates the tree. */
static core_status on_tree(core_solver *s) {
    if (s->tree->singular) return at_singular_start(s);
#if MODEL_TREE_OUTSIDE
    if (!s->machine->run->cosimulation) {
        core_status status = charts_calculate(s);
        return status ? status : check_values(s->machine);
    }
#endif
    return by_tree(s);
}

#endif

core_status calculate(core_solver *s) {
    machine *m = s->machine;
    double *v = m->values, *x = v + STATES;
    int status;
    if (!m->variables->stale) return CORE_OK;
#ifdef MODEL_TREE
    if (solver_has_tree(s) && !(m->run->mode & STARTING)) return on_tree(s);
#endif
    status =
        m->accepted->known ? closure_solve(&m->loops, x, m->z) : closure_start(&m->loops, x, m->z);
#ifdef MODEL_TREE
    s->tree->singular = 0;
    if (solver_has_tree(s) &&
        (status == CLOSURE_NEARLY || (!status && tree_starts_singular(s, m->z)))) {
        core_status start = tree_start_singular(s, m->z);
        return start ? start : at_singular_start(s);
    }
#endif
    if (status) return configuration_failed(m, status);
    if (m->run->mode == INITIALIZATION && machine_first_modes(m)) return CORE_ERROR;
    if (machine_rhs(m, m->run->time, x, m->z, v + DERIVATIVES, v + OUTPUTS))
        return machine_unsolved(m);
    memcpy(v + DEPENDENTS, m->z, NZ * sizeof *v);
    return check_joint_values(m);
}
