/* A serial arm: its pose, its Jacobian, and the displacement to a target pose.
 *
 * Re-entrant: no globals and no allocation. Poses are 4x4, row by row; their last rows are not
 * read. Lengths are divided by the length of the arm wherever they are combined with angles.
 */
#ifndef MBS_ARM_H
#define MBS_ARM_H

enum { ARM_JOINTS = 64, /* most joints */ ARM_STEPS = 60 /* most steps of a descent */ };

typedef struct {
    int n;
    const double *gaps; /* (n + 1, 4, 4) constant transforms before, between and after joints */
    const unsigned char *prismatic; /* (n,) whether prismatic along z, else revolute about z */
    double length;                  /* typical length of the arm [m] */
} arm;

/* Configuration, and its pose, displacement to the target and Jacobian. */
typedef struct {
    double T[16];            /* pose of the end frame */
    double gap[6];           /* to the target, [translation / length; rotation vector] */
    double cost;             /* |gap|^2 */
    double q[ARM_JOINTS];    /* positions [rad or m] */
    double J[ARM_JOINTS][6]; /* velocity [V / length; w] of the end frame for unit velocity of
                                each joint, in the base; lengths in arm lengths */
} configuration;

void configuration_copy(const arm *a, configuration *to, const configuration *from);

void arm_pose(const arm *a, const double *q, double *T);

/* Computes all other members of p from p->q. */
void arm_examine(const arm *a, const double *target, configuration *p);

/* Largest element of |T - target| [m and 1]. */
double arm_residual(const double *target, const double *T);

/* Largest element of |T - target| with lengths in arm lengths. */
double arm_relative_residual(const arm *a, const double *target, const double *T);

/* Whether T is the target pose up to rounding: a relative residual below 1e-12. */
int arm_reaches(const arm *a, const double *target, const double *T);

/* Unit of a joint in the Jacobian: 1 rad, or the length of the arm [m]. */
double arm_unit(const arm *a, int joint);

/* Wraps all angles into (-pi, pi]. */
void arm_wrap(const arm *a, double *q);

/* Levenberg-Marquardt steps from p->q towards the target pose. They end at a solution up to
 * rounding, or at a smallest distance greater than zero. */
void arm_descend(const arm *a, const double *target, configuration *p);

/* Gauss-Newton steps from x = q / unit for the target pose and the constraint held . x = value. */
void arm_correct(const arm *a, const double *target, const double *held, double value,
                 int iterations, double *x);

/* Gauss-Newton steps from x = q / unit for the target pose and the distance `radius` from a centre;
 * x is a solution on the sphere if one is near. */
void arm_reach_sphere(const arm *a, const double *target, const double *centre, double radius,
                      double *x);

/* Follows a self-motion from points[0] (x = q / unit) along a tangent, with residuals up to
 * `limit`. If `sided`, the path stays on its curve where other curves pass close by. Returns the
 * number of points, most + 1 at most; sets *closed if the last point equals the first. */
long long arm_walk(const arm *a, const double *target, const double *tangent, double limit,
                   long long most, int sided, double *points, int *closed);

/* Refines q to a solution near it, if that has a smaller residual. Returns the residual. */
double arm_polish(const arm *a, const double *target, double *q);

#endif
