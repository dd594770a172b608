/* Local tangent coordinates along the branch of motion, and the state at given coordinates.
 *
 * The coordinates xi = C (q - q0) have C = T' M N^+ at the origin q0, with the tangents T. The
 * tangents are orthogonal to the rows in the metric of M, so that the direction in which the rows
 * lose rank has no effect on the accelerations u'.
 *
 * Source: Hairer, Lubich and Wanner 2006, IV.5.3.
 */
#ifndef MBS_PASSAGE_CHART_H
#define MBS_PASSAGE_CHART_H

#include "passage_data.h"

/* Compute the matrix C from the frame at the origin. Returns 1 on failure. */
int chart_make(passage *g);

/* Compute u = C N v, the rates of the chart coordinates, at the frame p. */
void chart_rates(const passage *g, const passage_frame *p, const double *v, double *y);

/* Compute D = C N (d, nv), the rates of the chart coordinates per velocity. */
void chart_rate_rows(const passage *g, const passage_rows *rows, double *D);

/* Compute the chart coordinates y = (xi, u, z) of x. Returns 1 on failure. */
int chart_coordinates(passage *g, double t, const double *x, double *y);

/* Compute the state x at the chart coordinates y = (xi, u, z), and the slopes of x and y. Returns a
 * status of the stepper. */
int chart_state(passage *g, double t, const double *y, double *x, double *xdot, double *ydot);

#endif
