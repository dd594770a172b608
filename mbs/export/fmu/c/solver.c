/* Equations for the solver of co-simulation. Loops are closed at every evaluation. */
#include "solver.h"

#include "closure.h"
#include "internal.h"
#include "projection.h"

#include <math.h>
#include <string.h>

static int rhs(void *user, double t, const double *x, double *xdot) {
    core *c = user;
    return closure_solve(&c->loops, x, c->z) || core_call_rhs(c, t, x, c->z, xdot, NULL);
}

#if defined MODEL_RODAS && !defined MODEL_TREE
static int jacobian(void *user, double t, const double *x, double *J, double *f_t) {
    core *c = user;
    double du[NU + 1];
    if (closure_solve(&c->loops, x, c->z)) return 1;
    core_point(c, &t, x, c->z);
    core_input_rates(c, t, du);
    c->arg[5] = du;
    c->res[0] = J;
    c->res[1] = f_t;
    return mbs_jacobian(c->arg, c->res, c->iw, c->w, 0);
}
#endif

#ifdef MODEL_TREE

static int tree_rhs(void *user, double t, const double *x, double *xdot) {
    core *c = user;
    core_point(c, &t, x, c->z);
    c->res[0] = xdot;
    c->res[1] = NULL;
    return mbs_tree_rhs(c->arg, c->res, c->iw, c->w, 0);
}

static int tree_project_once(void *user, double t, const double *x, double *after,
                             double *residual) {
    core *c = user;
    core_point(c, &t, x, c->z);
    c->res[0] = after;
    c->res[1] = residual;
    return mbs_tree_project(c->arg, c->res, c->iw, c->w, 0);
}

static int tree_project(void *user, double t, double *x) {
    core *c = user;
    double projected[NT];
    if (!passage_project(c->passage, t, x)) return 0;
    return projection_converge(NT, tree_project_once, c, t, x, projected);
}

static int tree_rows(void *user, double t, const double *x, const passage_rows *r) {
    core *c = user;
    double *const to[] = {r->position, r->slope, r->J, r->b, r->c, r->N, r->bend, r->rank};
    core_point(c, &t, x, c->z);
    memcpy(c->res, to, sizeof to);
    return mbs_tree_rows(c->arg, c->res, c->iw, c->w, 0);
}

static int tree_forces(void *user, double t, const double *x, double *M, double *f, double *rate) {
    core *c = user;
    core_point(c, &t, x, c->z);
    c->res[0] = M;
    c->res[1] = f;
    c->res[2] = rate;
    return mbs_tree_forces(c->arg, c->res, c->iw, c->w, 0);
}

static int tree_regularity(void *user, double t, const double *x, double *value) {
    core *c = user;
    core_point(c, &t, x, c->z);
    c->res[0] = value;
    return mbs_tree_regularity(c->arg, c->res, c->iw, c->w, 0);
}

#ifdef MODEL_RODAS
static int tree_jacobian(void *user, double t, const double *x, double *J, double *f_t) {
    core *c = user;
    double du[NU + 1];
    core_point(c, &t, x, c->z);
    core_input_rates(c, t, du);
    c->arg[5] = du;
    c->res[0] = J;
    c->res[1] = f_t;
    return mbs_tree_jacobian(c->arg, c->res, c->iw, c->w, 0);
}
#endif

static int init_tree(core *c) {
    static const passage_size size = MODEL_PASSAGE;
    static const passage_model model = {tree_rows, tree_forces, tree_regularity, MODEL_REGULARITY};
#ifdef MODEL_RODAS
    if (c->m.cosimulation)
        rodas_init(&c->solver, NT, tree_rhs, tree_jacobian, c, c->m.solver, c->work);
    else
#endif
    dopri5_init(&c->solver, NT, tree_rhs, c, c->m.solver, c->work);
    c->solver.project = tree_project;
    c->passage = passage_new(&c->solver, &size, NULL, &model, &c->m.passage, c->m.origin);
    return c->passage == NULL;
}

#if MODEL_TREE_OUTSIDE
void core_take_states(core *c, int tree) {
    c->solver.n = tree ? NT : NX;
    c->solver.project = tree ? tree_project : NULL;
}
#endif

core_status core_start_tree(core *c) {
    double t = c->m.time;
    passage_start(c->passage);
    core_point(c, &t, c->m.values + STATES, c->m.values + DEPENDENTS);
    c->res[0] = c->m.tree;
    if (mbs_tree_start(c->arg, c->res, c->iw, c->w, 0) || !stepper_all_finite(c->m.tree, NT) ||
        tree_project(c, t, c->m.tree))
        return core_no_answer(c, "%s: the velocities have no solution at time %.9g", c->name, t);
    return CORE_OK;
}

/* Error for a singular start whose velocities select no branch. The message names the joint whose
 * velocity the loops constrain least. */
static core_status undetermined(core *c) {
    static const passage_size size = MODEL_PASSAGE;
    int k = passage_loosest(c->passage, c->m.time, c->m.tree, MODEL_TREE_UNITS), i, known = -1;
    for (i = 0; i < NX; i++)
        if (MODEL_TREE_STATES[i] == size.nq + k) known = STATES + i;
    for (i = 0; i < N_PASSIVE; i++)
        if (MODEL_TREE_PASSIVE[i] == size.nq + k) known = OUTPUTS + PASSIVE_V + i;
    return core_no_answer(
        c, "%s: it starts at time %.9g in a singular configuration (%s), where branches of motion "
           "meet, and its velocities are those of no branch with the mobility of the mechanism; "
           "the loops hardly hold %s there: set velocities of one branch, also of dependent joints, "
           "or start beside it", c->name, c->m.time, core_where(c),
        k < 0 || known < 0 ? "the joints" : MODEL_NAMES[known]);
}

/* Set the state of the tree from the states, z and the given velocities of dependent joints. */
static void place_tree(core *c, const double *z) {
    double *X = c->m.tree;
    int i;
    passage_start(c->passage);
    for (i = 0; i < NX; i++) X[MODEL_TREE_STATES[i]] = c->m.values[STATES + i];
    for (i = 0; i < NZ; i++) X[MODEL_TREE_DEPENDENTS[i]] = z[i];
    for (i = 0; i < N_PASSIVE; i++) X[MODEL_TREE_PASSIVE[i]] = c->m.speeds[i];
}

int core_starts_singular(core *c, const double *z) {
    place_tree(c, z);
    return passage_singular(c->passage, c->m.time, c->m.tree) ||
           closure_singular(&c->loops, c->m.values + STATES, z);
}

core_status core_start_singular(core *c, double *z) {
    static const passage_size size = MODEL_PASSAGE;
    double *X = c->m.tree, on[NT];
    int kept[N_HELD + N_PASSIVE + 1], count = 0, i;
    place_tree(c, z);
    if (passage_place(c->passage, c->m.time, X, MODEL_TREE_DEPENDENTS, NZ))
        return core_no_answer(c, "%s: unclosable configuration at time %.9g (%s): no dependent "
                              "coordinates near the last ones close the loops; start elsewhere or "
                              "move less", c->name, c->m.time, core_where(c));
    for (i = 0; i < NZ; i++) z[i] = X[MODEL_TREE_DEPENDENTS[i]];
    if (core_first_modes(c)) return CORE_ERROR;
    for (i = 0; i < N_HELD; i++) kept[count++] = MODEL_TREE_HELD[i];
    for (i = 0; i < N_PASSIVE; i++)
        if (c->m.speeds[i] != MODEL_START[OUTPUTS + PASSIVE_V + i])
            kept[count++] = MODEL_TREE_PASSIVE[i] - size.nq;
    if (passage_velocities(c->passage, c->m.time, X, kept, count))
        return core_no_answer(
            c, "%s: it starts at time %.9g in a singular configuration (%s) in which the loops allow "
               "no motion with the velocities that are set; set others, also of dependent joints, "
               "such as %s, or start elsewhere", c->name, c->m.time, core_where(c),
            MODEL_NAMES[OUTPUTS + PASSIVE_V]);
    if (passage_slope(c->passage, c->m.time, X, c->m.slope, on)) return undetermined(c);
    memcpy(X, on, sizeof(double) * (size_t)size.nq); /* positions on the branch */
    c->m.singular = 1;
    core_show_tree(c);
    return CORE_OK;
}

void core_show_slope(const double *slope, double *y) {
    static const passage_size size = MODEL_PASSAGE;
    int i;
    for (i = 0; i < N_HELD; i++) y[i] = slope[size.nq + MODEL_TREE_HELD[i]];
    for (i = 0; i < N_PASSIVE; i++) y[PASSIVE_A + i] = slope[MODEL_TREE_PASSIVE[i]];
}

void core_show_tree(core *c) {
    int i;
    for (i = 0; i < NX; i++) c->m.values[STATES + i] = c->m.tree[MODEL_TREE_STATES[i]];
    for (i = 0; i < NZ; i++) c->m.values[DEPENDENTS + i] = c->m.tree[MODEL_TREE_DEPENDENTS[i]];
    memcpy(c->m.configuration_x, c->m.values + STATES, NX * sizeof(double));
    memcpy(c->m.configuration_z, c->m.values + DEPENDENTS, NZ * sizeof(double));
}

int core_call_tree(core *c, const double *X, double *Xdot, double *y) {
    core_point(c, &c->m.time, X, c->z);
    c->res[0] = Xdot;
    c->res[1] = y;
    return mbs_tree_rhs(c->arg, c->res, c->iw, c->w, 0);
}

#endif

int core_init_solver(core *c) {
#ifdef MODEL_TREE
    if (ON_TREE(c)) return init_tree(c);
#endif
#if defined MODEL_RODAS && !defined MODEL_TREE
    rodas_init(&c->solver, NX, rhs, jacobian, c, c->m.solver, c->work);
#elif defined MODEL_FIXED_STEP
    rk4_init(&c->solver, NX, rhs, c, c->m.solver, c->work);
#else
    dopri5_init(&c->solver, NX, rhs, c, c->m.solver, c->work);
#endif
    c->solver.nominal = MODEL_NOMINAL + STATES;
#ifdef MODEL_FIXED_STEP
    stepper_fix(&c->solver, MODEL_FIXED_STEP);
#endif
    return 0;
}

#ifdef MODEL_APPROACHES
/* First step after an event [s]; later steps grow tenfold at most. Two bodies at any speed then
 * meet in a detected contact before they pass through each other. */
static const double AFTER_CONTACT = 1e-9;
#endif

void core_prepare_solver(core *c) {
    c->solver.rtol = c->solver.atol = c->m.tolerance;
#ifdef MODEL_MAX_STEP
    c->solver.h_max = MODEL_MAX_STEP;
#endif
#ifdef MODEL_APPROACHES
    c->solver.afresh = AFTER_CONTACT;
#endif
}
