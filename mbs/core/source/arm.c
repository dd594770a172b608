#include "arm.h"

#include <math.h>
#include <string.h>

#include "rigid.h"

static const double REACHED = 1e-12;

/* T = T G; G is not changed. */
static void walk(double *T, const double *G) {
    int i;
    for (i = 0; i < 12; i += 4) {
        double x = T[i], y = T[i + 1], z = T[i + 2];
        T[i] = x * G[0] + y * G[4] + z * G[8];
        T[i + 1] = x * G[1] + y * G[5] + z * G[9];
        T[i + 2] = x * G[2] + y * G[6] + z * G[10];
        T[i + 3] += x * G[3] + y * G[7] + z * G[11];
    }
}

void arm_pose(const arm *a, const double *q, double *T) {
    int k;
    memcpy(T, a->gaps, 16 * sizeof(double));
    for (k = 0; k < a->n; k++) {
        rigid_move(T, q[k], a->prismatic[k]);
        walk(T, a->gaps + 16 * (k + 1));
    }
}

double arm_unit(const arm *a, int joint) { return a->prismatic[joint] ? a->length : 1.0; }

void arm_wrap(const arm *a, double *q) {
    int k;
    for (k = 0; k < a->n; k++) {
        if (a->prismatic[k] || (q[k] > -PI && q[k] <= PI)) continue;
        q[k] = remainder(q[k], 2.0 * PI);
        if (q[k] <= -PI) q[k] += 2.0 * PI;
    }
}

/* The axis of a rotation by pi. */
static void half_rotation_axis(const double R[3][3], double *axis) {
    double diagonal[3], size = 0.0;
    int i, k = 0;
    for (i = 0; i < 3; i++) diagonal[i] = 0.5 * (R[i][i] + 1.0);
    for (i = 1; i < 3; i++)
        if (diagonal[i] > diagonal[k]) k = i;
    for (i = 0; i < 3; i++) {
        axis[i] = i == k ? diagonal[k] : 0.5 * R[i][k];
        size += axis[i] * axis[i];
    }
    for (i = 0; i < 3; i++) axis[i] /= sqrt(size);
}

/* The rotation vector of R = target T'. */
static void rotation_between(const double *target, const double *T, double *rotation) {
    double R[3][3], vector[3], s, angle;
    int i, k;
    for (i = 0; i < 3; i++)
        for (k = 0; k < 3; k++)
            R[i][k] = target[4 * i] * T[4 * k] + target[4 * i + 1] * T[4 * k + 1] +
                      target[4 * i + 2] * T[4 * k + 2];
    vector[0] = R[2][1] - R[1][2];
    vector[1] = R[0][2] - R[2][0];
    vector[2] = R[1][0] - R[0][1];
    s = 0.5 * sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]);
    if (s <= 1e-9 && R[0][0] + R[1][1] + R[2][2] < 0.0) {
        half_rotation_axis((const double (*)[3])R, rotation);
        for (i = 0; i < 3; i++) rotation[i] *= PI;
        return;
    }
    angle = s > 1e-9 ? atan2(s, 0.5 * (R[0][0] + R[1][1] + R[2][2] - 1.0)) / (2.0 * s) : 0.5;
    for (i = 0; i < 3; i++) rotation[i] = angle * vector[i];
}

static void find_gap(const arm *a, const double *target, configuration *p) {
    int i;
    rotation_between(target, p->T, p->gap + 3);
    for (i = 0; i < 3; i++) p->gap[i] = (target[4 * i + 3] - p->T[4 * i + 3]) / a->length;
    p->cost = 0.0;
    for (i = 0; i < 6; i++) p->cost += p->gap[i] * p->gap[i];
}

void arm_examine(const arm *a, const double *target, configuration *p) {
    double x[3], *T = p->T;
    int i, k;
    memcpy(T, a->gaps, 16 * sizeof(double));
    for (k = 0; k < a->n; k++) {
        double *J = p->J[k];
        for (i = 0; i < 3; i++) {
            J[i] = T[4 * i + 3];
            J[3 + i] = T[4 * i + 2];
        }
        rigid_move(T, p->q[k], a->prismatic[k]);
        walk(T, a->gaps + 16 * (k + 1));
    }
    for (k = 0; k < a->n; k++) {
        double *J = p->J[k], *z = J + 3;
        for (i = 0; i < 3; i++) x[i] = (T[4 * i + 3] - J[i]) / a->length;
        J[0] = a->prismatic[k] ? z[0] : z[1] * x[2] - z[2] * x[1];
        J[1] = a->prismatic[k] ? z[1] : z[2] * x[0] - z[0] * x[2];
        J[2] = a->prismatic[k] ? z[2] : z[0] * x[1] - z[1] * x[0];
        if (a->prismatic[k]) z[0] = z[1] = z[2] = 0.0;
    }
    find_gap(a, target, p);
}

static double largest(const double *target, const double *T, double length) {
    double worst = 0.0;
    int i;
    for (i = 0; i < 12; i++) {
        double miss = fabs(T[i] - target[i]);
        if (i % 4 == 3) miss /= length;
        if (!(miss < HUGE_VAL)) return HUGE_VAL;
        if (miss > worst) worst = miss;
    }
    return worst;
}

double arm_residual(const double *target, const double *T) { return largest(target, T, 1.0); }

double arm_relative_residual(const arm *a, const double *target, const double *T) {
    return largest(target, T, a->length);
}

int arm_reaches(const arm *a, const double *target, const double *T) {
    return arm_relative_residual(a, target, T) < REACHED;
}
