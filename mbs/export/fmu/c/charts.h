/* Continuous states of closed loops in model exchange: values at the states.
 *
 * The states are those of the independent joints. Near configurations in which the independent
 * joints no longer determine the others, and where branches of motion meet, the states are local
 * tangent coordinates (passage.h). All other values are computed from the states at every
 * evaluation, on all closure rows and on the branch of the last accepted states. A change of
 * coordinates is an event that changes the meaning and the values of the states; an event indicator
 * triggers it (chart_choice.h). Positions and velocities of joints are therefore outputs, not
 * states.
 */
#ifndef MBS_CHARTS_H
#define MBS_CHARTS_H

#include "solver.h"

#if MODEL_TREE_OUTSIDE

/* Compute derivatives, outputs, joint states and dependent coordinates from the states. */
core_status charts_calculate(core_solver *s);

/* Accept the present state: the branch of motion is followed from it. */
void charts_accept(core_solver *s);

/* Copy the joint states to the states of the external integrator. */
void charts_show_joints(core_solver *s);

/* Directional derivative while tangent coordinates are in use, by central differences. dt, dx, du
 * and dp: direction in time, states, inputs and parameters. Results: derivatives of the state rates
 * (dxdot), outputs (dy), joint states and their rates (djoints, dslopes) and dependents (dz). */
typedef struct {
    double dt, dx[NX + 1], du[NU + 1], dp[NP + 1];
    double dxdot[NX + 1], dy[NY + 1], djoints[NX + 1], dslopes[NX + 1], dz[NZ + 1];
} charts_tangent;

core_status charts_difference(core_solver *s, charts_tangent *along);

#endif
#endif
