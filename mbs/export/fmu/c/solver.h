/* The solver: integrator, tolerance and coordinates of the integration of an instance.
 *
 * In co-simulation it makes the internal steps. In model exchange it keeps the time and the
 * coordinates of the external integrator. The integrated coordinates are the states, or the
 * coordinates of all joints of the tree if the model has closed loops with tree equations.
 */
#ifndef MBS_SOLVER_H
#define MBS_SOLVER_H

#include "machine.h"
#include "stepper.h"

#ifdef MODEL_TREE
#include "dopri5.h"
#include "passage.h"
#endif

#if defined MODEL_RODAS
#include "rodas.h"
#define SOLVER_WORK RODAS_WORK
#elif defined MODEL_FIXED_STEP
#include "rk4.h"
#define SOLVER_WORK RK4_WORK
#else
#include "dopri5.h"
#define SOLVER_WORK DOPRI5_WORK
#endif

#ifdef MODEL_TREE
/* State of the tree: positions and velocities of all joints, states of components. */
typedef struct {
    int loose;    /* 1 if X must be projected onto its rows before the next step */
    int singular; /* 1 while the run is at a start in a singular configuration */
    double X[NT];
    double slope[NT];       /* derivative of X, at the start or for an external integrator */
    passage_memory passage; /* data of the steps through singular configurations */
    double origin[NT];      /* origin of the chart of these steps */
} core_tree;

extern const passage_size TREE_SIZE;
#endif

#if MODEL_TREE_OUTSIDE
/* Coordinates for which the continuous states of model exchange stand, see charts.h. */
typedef struct {
    int tangent;      /* 1 if the states are local tangent coordinates */
    int loose;        /* 1 if joint values were set, so that the joints become the states again */
    int settled;      /* 1 if the coordinates of the next steps are chosen */
    double alignment; /* alignment of the tangents with the chart: 1 at its origin, 0 orthogonal */
    double time, X[NT], slope[NT]; /* last accepted time, tree state and its derivative */
} core_charts;
#endif

/* Data that a run changes. */
typedef struct {
    double tolerance;                             /* relative, and absolute in nominal sizes */
    double stepper[STEPPER_MEMORY(N_INTEGRATED)]; /* step size and history of the integrator */
#ifdef MODEL_TREE
    core_tree tree;
#endif
#if MODEL_TREE_OUTSIDE
    core_charts charts;
#endif
} core_solver_memory;

typedef struct {
    machine *machine;
    core_solver_memory *memory;
    stepper stepper;
#ifdef MODEL_TREE
    core_tree *tree;  /* memory->tree */
    passage *passage; /* NULL if the tree is not integrated */
    double work[LARGER(SOLVER_WORK(N_INTEGRATED), DOPRI5_WORK(NT)) + 1];
#else
    double work[SOLVER_WORK(NX) + 1];
#endif
#if MODEL_TREE_OUTSIDE
    core_charts *charts; /* memory->charts */
#endif
} core_solver;

/* Whether the instance integrates the coordinates of the tree. */
static inline int solver_has_tree(const core_solver *s) {
#ifdef MODEL_TREE
    return s->machine->run->cosimulation ? MODEL_TREE_INSIDE : MODEL_TREE_OUTSIDE;
#else
    (void)s;
    return 0;
#endif
}

/* Whether the coordinates of the tree are the present coordinates; else the states are. */
static inline int solver_on_tree(const core_solver *s) {
#if MODEL_TREE_OUTSIDE
    return s->machine->run->cosimulation ? MODEL_TREE_INSIDE : s->charts->tangent;
#else
    return solver_has_tree(s);
#endif
}

/* The present coordinates: those of the tree (NT,), or the states (NX,). */
static inline double *solver_coordinates(core_solver *s) {
#ifdef MODEL_TREE
    if (solver_on_tree(s)) return s->tree->X;
#endif
    return s->machine->values + STATES;
}

/* Whether the run is at a start in a singular configuration. */
static inline int solver_starts_singular(const core_solver *s) {
#ifdef MODEL_TREE
    return s->tree->singular;
#else
    (void)s;
    return 0;
#endif
}

/* Leave a start in a singular configuration. */
static inline void solver_leave_start(core_solver *s) {
#ifdef MODEL_TREE
    s->tree->singular = 0;
#else
    (void)s;
#endif
}

/* Initialise a solver, once per instance. Returns 1 if no memory is left. */
int solver_init(core_solver *s, machine *m, core_solver_memory *memory);
void solver_end(core_solver *s);

/* Set the tolerance and the options of the next steps. */
void solver_prepare(core_solver *s);

/* Set which coordinates the integrator has in model exchange: tree = 1 for those of the tree, 0 for
 * the states. No effect if the model has no charts. */
void solver_take_coordinates(core_solver *s, int tree);

#ifdef MODEL_TREE
/* Project tree coordinates X (NT,) onto their rows at time t. Nonzero if it does not converge. */
int solver_project_tree(core_solver *s, double t, double *X);
#endif

#endif
