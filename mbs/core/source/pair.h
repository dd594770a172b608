/* A point p and a direction z as the fifteen numbers (1, p.p, p.z, p, z, p x z, p.p z - 2 p.z p),
 * which every rigid displacement maps linearly.
 *
 * Source: Raghavan and Roth 1993, the fourteen equations; here as a representation of the group.
 */
#ifndef MBS_PAIR_H
#define MBS_PAIR_H

enum { PAIR = 15 };

/* Of the origin and the z axis of a frame T (4, 4), row by row. */
void pair_of(const double *T, double *w);

/* What a displacement T makes of the numbers w. */
void pair_carry(const double *T, double *w);

/* (3, 15) parts of what a joint makes of w: with 1, cos q, sin q of a rotation about z by q, or
 * with 1, r, r^2 of a translation along z by r. */
void pair_parts(int prismatic, const double *w, double *parts);

#endif
