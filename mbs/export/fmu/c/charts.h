/* Model exchange of closed loops: what the states are that an integrator outside carries.
 *
 * They are the states of the independent joints; but where these lose their hold on the others, and
 * where branches of motion meet, they are local tangent coordinates (passage.h). All else follows at
 * every evaluation, on all rows of the loops and on the branch that the last accepted states lead to.
 * Another choice of coordinates is an event, at which the states change their meaning and values; an
 * indicator asks for it. So positions and velocities of joints are outputs, not states.
 */
#ifndef MBS_CHARTS_H
#define MBS_CHARTS_H

#include "core.h"

#if MODEL_TREE_OUTSIDE

/* The states after the initialization. */
core_status charts_start(core *c);

/* Derivatives, outputs, joints and dependents of the states. */
core_status charts_refresh(core *c);

/* The state of the tree goes back along its motion by this time [s]. */
void charts_back(core *c, double time);

/* In event mode something of the joints is about to be set: they are to be the states again. */
core_status charts_set(core *c);

/* Event mode is entered. */
core_status charts_pause(core *c);

/* What asks for other coordinates. The states are on the motion: it is followed from here. */
core_status charts_show_indicator(core *c);

/* The states were accepted; event: 1 where the coordinates are to change. */
core_status charts_completed(core *c, int *event);

/* In event mode; changed: 1 where the states are other ones now. */
core_status charts_update(core *c, int *changed);

/* How rates and outputs change along a direction of time, states, inputs and parameters, where
 * tangent coordinates are in use: by differences. */
typedef struct {
    double dt, dx[NX + 1], du[NU + 1], dp[NP + 1];
    double dxdot[NX + 1], dy[NY + 1], djoints[NX + 1], dslopes[NX + 1], dz[NZ + 1];
} charts_tangent;

core_status charts_difference(core *c, charts_tangent *along);

#endif
#endif
