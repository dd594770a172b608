#include "tree_state.h"

#ifdef MODEL_TREE

#include <math.h>
#include <string.h>

#include "finite.h"
#include "passage_start.h"

core_status tree_start(core_solver *s) {
    machine *m = s->machine;
    double t = m->run->time;
    passage_start(s->passage);
    machine_point(m, &t, m->values + STATES, m->values + DEPENDENTS);
    m->res[0] = s->tree->X;
    if (machine_call(m, mbs_tree_start) || !all_finite(s->tree->X, NT) ||
        solver_project_tree(s, t, s->tree->X))
        return log_failed(m->log, "the velocities have no solution at time %.9g", t);
    return CORE_OK;
}

/* Error for a singular start whose velocities select no branch. The message names the joint whose
 * velocity the loops constrain least. */
static core_status undetermined(core_solver *s) {
    core_log *l = s->machine->log;
    double t = s->machine->run->time;
    int k = passage_loosest(s->passage, t, s->tree->X, MODEL_TREE_UNITS), i, known = -1;
    for (i = 0; i < NX; i++)
        if (MODEL_TREE_STATES[i] == TREE_SIZE.nq + k) known = STATES + i;
    for (i = 0; i < N_PASSIVE; i++)
        if (MODEL_TREE_PASSIVE[i] == TREE_SIZE.nq + k) known = OUTPUTS + PASSIVE_V + i;
    return log_failed(
        l,
        "it starts at time %.9g in a singular configuration (%s), where branches of motion "
        "meet, and its velocities are those of no branch with the mobility of the mechanism; "
        "the loops hardly hold %s there: set velocities of one branch, also of dependent joints, "
        "or start beside it",
        t, log_where(l), k < 0 || known < 0 ? "the joints" : MODEL_NAMES[known]);
}

/* Set the state of the tree from the states, z and the given velocities of dependent joints. */
static void set_start(core_solver *s, const double *z) {
    const core_variables *v = s->machine->variables;
    double *X = s->tree->X;
    int i;
    passage_start(s->passage);
    for (i = 0; i < NX; i++) X[MODEL_TREE_STATES[i]] = v->values[STATES + i];
    for (i = 0; i < NZ; i++) X[MODEL_TREE_DEPENDENTS[i]] = z[i];
    for (i = 0; i < N_PASSIVE; i++) X[MODEL_TREE_PASSIVE[i]] = v->speeds[i];
}

int tree_starts_singular(core_solver *s, const double *z) {
    machine *m = s->machine;
    set_start(s, z);
    return passage_singular(s->passage, m->run->time, s->tree->X) ||
           closure_singular(&m->loops, m->values + STATES, z);
}

core_status tree_start_singular(core_solver *s, double *z) {
    machine *m = s->machine;
    const double *speeds = m->variables->speeds, t = m->run->time;
    double *X = s->tree->X, on[NT];
    int kept[N_HELD + N_PASSIVE + 1], count = 0, i;
    set_start(s, z);
    if (passage_place(s->passage, t, X, MODEL_TREE_DEPENDENTS, NZ))
        return log_failed(m->log,
                          "unclosable configuration at time %.9g (%s): no dependent coordinates "
                          "near the last ones close the loops; start elsewhere or move less",
                          t, log_where(m->log));
    for (i = 0; i < NZ; i++) z[i] = X[MODEL_TREE_DEPENDENTS[i]];
    if (machine_first_modes(m)) return CORE_ERROR;
    for (i = 0; i < N_HELD; i++) kept[count++] = MODEL_TREE_HELD[i];
    for (i = 0; i < N_PASSIVE; i++)
        if (speeds[i] != MODEL_START[OUTPUTS + PASSIVE_V + i])
            kept[count++] = MODEL_TREE_PASSIVE[i] - TREE_SIZE.nq;
    if (passage_velocities(s->passage, t, X, kept, count))
        return log_failed(
            m->log,
            "it starts at time %.9g in a singular configuration (%s) in which the loops allow "
            "no motion with the velocities that are set; set others, also of dependent joints, "
            "such as %s, or start elsewhere",
            t, log_where(m->log), MODEL_NAMES[OUTPUTS + PASSIVE_V]);
    if (passage_slope(s->passage, t, X, s->tree->slope, on)) return undetermined(s);
    memcpy(X, on, sizeof(double) * (size_t)TREE_SIZE.nq); /* positions on the branch */
    s->tree->singular = 1;
    tree_show(s);
    return CORE_OK;
}

void tree_show_slope(const double *slope, double *y) {
    int i;
    for (i = 0; i < N_HELD; i++) y[i] = slope[TREE_SIZE.nq + MODEL_TREE_HELD[i]];
    for (i = 0; i < N_PASSIVE; i++) y[PASSIVE_A + i] = slope[MODEL_TREE_PASSIVE[i]];
}

void tree_show(core_solver *s) {
    machine *m = s->machine;
    double *v = m->values;
    int i;
    for (i = 0; i < NX; i++) v[STATES + i] = s->tree->X[MODEL_TREE_STATES[i]];
    for (i = 0; i < NZ; i++) v[DEPENDENTS + i] = s->tree->X[MODEL_TREE_DEPENDENTS[i]];
    memcpy(m->accepted->x, v + STATES, NX * sizeof *v);
    memcpy(m->accepted->z, v + DEPENDENTS, NZ * sizeof *v);
}

int tree_call(core_solver *s, const double *X, double *Xdot, double *y) {
    machine *m = s->machine;
    machine_point(m, &m->run->time, X, m->z);
    m->res[0] = Xdot;
    m->res[1] = y;
    return machine_call(m, mbs_tree_rhs);
}

void tree_back(core_tree *tree, double time) {
    double *X = tree->X, *slope = tree->slope;
    int i;
    for (i = 0; i < NT; i++) X[i] -= time * slope[i];
    for (i = 0; i < TREE_SIZE.nq && tree_is_plain(); i++) {
        X[i] += 0.5 * time * time * slope[TREE_SIZE.nq + i];
        slope[i] -= time * slope[TREE_SIZE.nq + i];
    }
}

#endif
