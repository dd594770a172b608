/* Continuous states of closed loops in model exchange, for an external integrator.
 *
 * The states are those of the independent joints. Near configurations in which the independent
 * joints no longer determine the others, and where branches of motion meet, the states are local
 * tangent coordinates (passage.h). All other values are computed from the states at every
 * evaluation, on all closure rows and on the branch of the last accepted states. A change of
 * coordinates is an event that changes the meaning and the values of the states. An event indicator
 * triggers it. Positions and velocities of joints are therefore outputs, not states.
 */
#ifndef MBS_CHARTS_H
#define MBS_CHARTS_H

#include "core.h"

#if MODEL_TREE_OUTSIDE

/* Choose the states at the end of the initialization. */
core_status charts_start(core *c);

/* Compute derivatives, outputs, joint states and dependent coordinates from the states. */
core_status charts_refresh(core *c);

/* Move the state of the tree back along its motion by `time` [s]. */
void charts_back(core *c, double time);

/* Make the joint coordinates the states again, before event mode sets a joint value or a length. */
core_status charts_set(core *c);

/* Prepare for event mode. */
core_status charts_pause(core *c);

/* Compute the event indicator of a change of coordinates. If it is positive, the present state is
 * accepted: the branch is followed from it. */
core_status charts_show_indicator(core *c);

/* Accept the states after an integrator step. *event: 1 if the coordinates must change. */
core_status charts_completed(core *c, int *event);

/* Handle jumps and changes of coordinates in event mode. *changed: 1 if the states changed. */
core_status charts_update(core *c, int *changed);

/* Directional derivative while tangent coordinates are in use, by central differences. dt, dx, du
 * and dp: direction in time, states, inputs and parameters. Results: derivatives of the state rates
 * (dxdot), outputs (dy), joint states and their rates (djoints, dslopes) and dependents (dz). */
typedef struct {
    double dt, dx[NX + 1], du[NU + 1], dp[NP + 1];
    double dxdot[NX + 1], dy[NY + 1], djoints[NX + 1], dslopes[NX + 1], dz[NZ + 1];
} charts_tangent;

core_status charts_difference(core *c, charts_tangent *along);

#endif
#endif
