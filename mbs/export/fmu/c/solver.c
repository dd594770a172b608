/* Equations for the integrator, as functions of its coordinates. Loops are closed at every
 * evaluation. All callbacks return 0, or nonzero if they have no value. */
#include "solver.h"

#include <math.h>
#include <string.h>

#include "projection.h"

/* Derivatives of the states. */
static int states_rhs(void *user, double t, const double *x, double *xdot) {
    machine *m = ((core_solver *)user)->machine;
    return closure_solve(&m->loops, x, m->z) || machine_rhs(m, t, x, m->z, xdot, NULL);
}

#if defined MODEL_RODAS && !defined MODEL_TREE
/* d xdot / d x (NX, NX), column by column, and d xdot / d t (NX,). */
static int states_jacobian(void *user, double t, const double *x, double *J, double *f_t) {
    machine *m = ((core_solver *)user)->machine;
    double du[NU + 1];
    if (closure_solve(&m->loops, x, m->z)) return 1;
    machine_point(m, &t, x, m->z);
    machine_input_rates(m, t, du);
    m->arg[5] = du;
    m->res[0] = J;
    m->res[1] = f_t;
    return machine_call(m, mbs_jacobian);
}
#endif

#ifdef MODEL_TREE

const passage_size TREE_SIZE = MODEL_PASSAGE;

/* Derivatives of the coordinates of the tree. */
static int tree_rhs(void *user, double t, const double *X, double *Xdot) {
    machine *m = ((core_solver *)user)->machine;
    machine_point(m, &t, X, m->z);
    m->res[0] = Xdot;
    m->res[1] = NULL;
    return machine_call(m, mbs_tree_rhs);
}

/* One Newton step of the projection onto the rows. */
static int tree_project_once(void *user, double t, const double *X, double *after,
                             double *residual) {
    machine *m = ((core_solver *)user)->machine;
    machine_point(m, &t, X, m->z);
    m->res[0] = after;
    m->res[1] = residual;
    return machine_call(m, mbs_tree_project);
}

int solver_project_tree(core_solver *s, double t, double *X) {
    double projected[NT];
    if (!passage_project(s->passage, t, X)) return 0;
    return projection_converge(NT, tree_project_once, s, t, X, projected);
}

/* Projection onto the rows, as callback of the integrator. */
static int tree_project(void *user, double t, double *X) {
    return solver_project_tree((core_solver *)user, t, X);
}

/* Constraint rows, see passage.h. */
static int tree_rows(void *user, double t, const double *X, const passage_rows *r) {
    machine *m = ((core_solver *)user)->machine;
    double *const to[] = {r->position, r->slope, r->J, r->b, r->c, r->N, r->bend, r->rank};
    machine_point(m, &t, X, m->z);
    memcpy(m->res, to, sizeof to);
    return machine_call(m, mbs_tree_rows);
}

/* Inertia matrix M, forces f, and rates of the states of components, see passage.h. */
static int tree_forces(void *user, double t, const double *X, double *M, double *f, double *rate) {
    machine *m = ((core_solver *)user)->machine;
    machine_point(m, &t, X, m->z);
    m->res[0] = M;
    m->res[1] = f;
    m->res[2] = rate;
    return machine_call(m, mbs_tree_forces);
}

/* Measure of the independence of the rows, see passage.h. */
static int tree_regularity(void *user, double t, const double *X, double *value) {
    machine *m = ((core_solver *)user)->machine;
    machine_point(m, &t, X, m->z);
    m->res[0] = value;
    return machine_call(m, mbs_tree_regularity);
}

#ifdef MODEL_RODAS
/* d Xdot / d X (NT, NT), column by column, and d Xdot / d t (NT,). */
static int tree_jacobian(void *user, double t, const double *X, double *J, double *f_t) {
    machine *m = ((core_solver *)user)->machine;
    double du[NU + 1];
    machine_point(m, &t, X, m->z);
    machine_input_rates(m, t, du);
    m->arg[5] = du;
    m->res[0] = J;
    m->res[1] = f_t;
    return machine_call(m, mbs_tree_jacobian);
}
#endif

/* Initialise the integration of the tree. Returns 1 if no memory is left. */
static int init_tree(core_solver *s) {
    static const passage_model model = {tree_rows, tree_forces, tree_regularity, MODEL_REGULARITY};
#ifdef MODEL_RODAS
    if (s->machine->run->cosimulation)
        rodas_init(&s->stepper, NT, tree_rhs, tree_jacobian, s, s->memory->stepper, s->work);
    else
#endif
        dopri5_init(&s->stepper, NT, tree_rhs, s, s->memory->stepper, s->work);
    s->stepper.project = tree_project;
    s->passage =
        passage_new(&s->stepper, &TREE_SIZE, NULL, &model, &s->tree->passage, s->tree->origin);
    return s->passage == NULL;
}

#endif

void solver_take_coordinates(core_solver *s, int tree) {
#if MODEL_TREE_OUTSIDE
    s->stepper.n = tree ? NT : NX;
    s->stepper.project = tree ? tree_project : NULL;
#else
    (void)s, (void)tree;
#endif
}

int solver_init(core_solver *s, machine *m, core_solver_memory *memory) {
    s->machine = m;
    s->memory = memory;
#if MODEL_TREE_OUTSIDE
    s->charts = &memory->charts;
#endif
#ifdef MODEL_TREE
    s->tree = &memory->tree;
    if (solver_has_tree(s)) return init_tree(s);
#endif
#if defined MODEL_RODAS && !defined MODEL_TREE
    rodas_init(&s->stepper, NX, states_rhs, states_jacobian, s, memory->stepper, s->work);
#elif defined MODEL_FIXED_STEP
    rk4_init(&s->stepper, NX, states_rhs, s, memory->stepper, s->work);
#else
    dopri5_init(&s->stepper, NX, states_rhs, s, memory->stepper, s->work);
#endif
    s->stepper.nominal = MODEL_NOMINAL + STATES;
#ifdef MODEL_FIXED_STEP
    stepper_fix(&s->stepper, MODEL_FIXED_STEP);
#endif
    return 0;
}

void solver_end(core_solver *s) {
#ifdef MODEL_TREE
    passage_free(s->passage);
#endif
    (void)s;
}

#ifdef MODEL_APPROACHES
/* First step after an event [s]; later steps grow tenfold at most. Two bodies at any speed then
 * meet in a detected contact before they pass through each other. */
static const double AFTER_CONTACT = 1e-9;
#endif

void solver_prepare(core_solver *s) {
    s->stepper.rtol = s->stepper.atol = s->memory->tolerance;
#ifdef MODEL_MAX_STEP
    s->stepper.h_max = MODEL_MAX_STEP;
#endif
#ifdef MODEL_APPROACHES
    s->stepper.afresh = AFTER_CONTACT;
#endif
}
