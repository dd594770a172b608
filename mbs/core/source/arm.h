/* A serial arm of a few joints: its pose, its Jacobian, and the displacement to a target pose.
 *
 * Re-entrant: no globals and no allocation. Poses are 4x4, row by row, and their last rows are
 * never looked at. Lengths are measured by a length of the arm wherever they meet angles.
 */
#ifndef MBS_ARM_H
#define MBS_ARM_H

enum { ARM_JOINTS = 64, /* at most */ ARM_STEPS = 60 /* of a descent, at most */ };

typedef struct {
    int n;
    const double *gaps; /* (n + 1, 4, 4) constant transforms before, between and after joints */
    const unsigned char *prismatic; /* (n,) whether each is prismatic, else revolute; about z */
    double length;               /* of the arm's size [m] */
} arm;

/* A configuration and the quantities that follow from it. */
typedef struct {
    double T[16];            /* its pose */
    double gap[6];           /* to the target pose, [translation / length; rotation vector] */
    double cost;             /* |gap|^2 */
    double q[ARM_JOINTS];    /* rad or m */
    double J[ARM_JOINTS][6]; /* motion of the frame for each joint, [V / length; w], in the base;
                                lengths in arm lengths */
} configuration;

void configuration_copy(const arm *a, configuration *to, const configuration *from);

void arm_pose(const arm *a, const double *q, double *T);

/* From p->q, all the rest of p. */
void arm_examine(const arm *a, const double *target, configuration *p);

/* max |T - target| [m and 1]. */
double arm_residual(const double *target, const double *T);

/* The same with lengths in arm lengths. */
double arm_relative_residual(const arm *a, const double *target, const double *T);

/* Whether T is the target pose but for rounding: a relative residual below 1e-12. */
int arm_reaches(const arm *a, const double *target, const double *T);

/* One joint in the unit of its column of the Jacobian. */
double arm_unit(const arm *a, int joint);

/* All angles into (-pi, pi]. */
void arm_wrap(const arm *a, double *q);

/* Steps of Levenberg and Marquardt from p->q towards the target pose. They end where rounding, or a
 * smallest distance greater than zero, lets them go no further. */
void arm_descend(const arm *a, const double *target, configuration *p);

/* Gauss-Newton steps from x = q / unit towards the target pose and held . x = value. */
void arm_correct(const arm *a, const double *target, const double *held, double value,
                 int iterations, double *x);

/* Gauss-Newton steps from x = q / unit towards the target pose and a distance from a centre, to a
 * solution on the sphere where there is one. */
void arm_reach_sphere(const arm *a, const double *target, const double *centre, double radius,
                      double *x);

/* Follows a self-motion from points[0], in x = q / unit, along a tangent while residuals are within
 * the limit, and on its side of curves that pass close by if `sided`; gives how many points there are,
 * *closed where the last is the first again. There must be room for one more than the most. */
long long arm_walk(const arm *a, const double *target, const double *tangent, double limit,
                   long long most, int sided, double *points, int *closed);

/* The solution beside q, or q itself where nothing better was found; gives its residual. */
double arm_polish(const arm *a, const double *target, double *q);

#endif
