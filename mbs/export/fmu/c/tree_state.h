/* State of the tree of an instance: its start, also in singular configurations, and its display in
 * the variables of the model. */
#ifndef MBS_TREE_STATE_H
#define MBS_TREE_STATE_H

#include "solver.h"

#ifdef MODEL_TREE

/* Compute the first state from the states and dependent coordinates, for co-simulation. */
core_status tree_start(core_solver *s);

/* Whether the states and dependents z (NZ,) are a singular configuration. Sets s->tree->X. */
int tree_starts_singular(core_solver *s, const double *z);

/* Compute the first state and its derivative in a singular configuration. z (NZ,): dependents close
 * to it; replaced by those of the configuration. */
core_status tree_start_singular(core_solver *s, double *z);

/* Copy the state to the states and dependents of the model, and accept them. */
void tree_show(core_solver *s);

/* Copy the accelerations in slope (NT,) to the outputs y (NY,). */
void tree_show_slope(const double *slope, double *y);

/* Compute the derivative Xdot (NT,) and outputs y (NY,) at X and the present time. Returns 0, or
 * nonzero if the equations have no solution. */
int tree_call(core_solver *s, const double *X, double *Xdot, double *y);

/* Move the state back along its motion by `time` [s]. */
void tree_back(core_tree *tree, double time);

/* Whether positions and velocities correspond one to one, i.e. no joint has a quaternion. */
static inline int tree_is_plain(void) { return TREE_SIZE.nq == TREE_SIZE.nv; }

#endif
#endif
