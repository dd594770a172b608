/* Rigid displacements (4, 4), row by row; their last rows are never looked at, nor written. */
#ifndef MBS_RIGID_H
#define MBS_RIGID_H

#define PI 3.14159265358979323846

/* T = A B; T is neither of them. */
void rigid_product(const double *A, const double *B, double *T);

void rigid_inverse(const double *T, double *back);

/* T = T times the motion of a joint: a translation along z by q, or a rotation about it. */
void rigid_move(double *T, double q, int prismatic);

#endif
