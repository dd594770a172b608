/* Model exchange of closed loops: the states are positions and velocities of all joints.
 *
 * The independent joints alone may lose their hold on the others, and where branches of motion meet
 * they do not tell which one it is: the states that an integrator outside carries do. At every
 * evaluation they are put onto the loops: with the independent joints as they are, or, near such
 * configurations, with local tangent coordinates as they are (passage.h). What is removed by that is
 * the error of the integrator across the motion, which never comes back into it. Another choice of
 * coordinates is an event, in which the states themselves are put onto the loops.
 */
#ifndef MBS_CHARTS_H
#define MBS_CHARTS_H

#include "core.h"

#ifdef MODEL_TREE

/* The states after the initialization. */
core_status charts_start(core *c);

/* Derivatives, outputs and dependents of the states. */
core_status charts_refresh(core *c);

/* Rates of the dependent joints, where the other values are known. */
void charts_show_rates(core *c);

/* The states, or what they depend on, were set between steps: the dependent joints follow. */
void charts_set(core *c);

/* The states were accepted; event: 1 where the coordinates are to change. */
core_status charts_completed(core *c, int *event);

/* What tells an integrator outside that the coordinates are to change. */
core_status charts_show_indicator(core *c);

/* In event mode; changed: 1 where the states have moved. */
core_status charts_update(core *c, int *changed);

/* How rates and outputs change along a direction of time, states, inputs and parameters, where
 * tangent coordinates are in use: by differences. */
typedef struct {
    double dt, dx[NX + NF + 1], du[NU + 1], dp[NP + 1];
    double dxdot[NX + NF + 1], dy[NY + 1];
} charts_tangent;

core_status charts_difference(core *c, charts_tangent *along);

#endif
#endif
