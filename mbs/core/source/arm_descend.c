#include "arm.h"

#include <math.h>
#include <string.h>

#include "rigid.h"

enum { STALLS = 3, ROWS = 7 + ARM_JOINTS };
static const double SOLUTION = 1e-26;  /* largest cost of a solution, from rounding */
static const double FINEST = 1e-31;    /* cost below which nothing can be gained */
static const double WEAK = 1e-8;       /* relative pivot of normal equations that is rounding */
static const double LEAST = 1e-31;     /* smallest damping, so that no matrix is singular */
static const double DEPENDENT = 1e-12; /* damping of singular values that are rounding */
static const double ZERO = 2e-6;       /* damping along self-motions, accurate to the root of
                                          1e-12 */
static const double LONGEST = 0.3;     /* longest step of the linear range [rad or arm lengths] */
static const double DEPENDENT_THERE = 1e-10; /* DEPENDENT on a sphere, where motions meet */
/* Cosine of 26 degrees, largest change of direction in a step: curves hardly ever cross at smaller
 * angles */
static const double STRAIGHT = 0.9;
static const double FINISHED = 1e-14; /* step [rad or arm lengths] that is rounding */
static const double SETTLED = 1e-12;  /* step [rad or arm lengths] slightly above rounding */

void configuration_copy(const arm *a, configuration *to, const configuration *from) {
    size_t n = (size_t)a->n;
    memcpy(to->T, from->T, sizeof to->T);
    memcpy(to->gap, from->gap, sizeof to->gap);
    to->cost = from->cost;
    memcpy(to->q, from->q, n * sizeof *to->q);
    memcpy(to->J, from->J, n * sizeof *to->J);
}

/* Solves (J' J + shift) dx = J' gap by Cholesky. Returns 0 if the matrix is nearly singular. */
static int normal_step(const arm *a, const configuration *p, double shift, double *dx) {
    double L[ARM_JOINTS][ARM_JOINTS], most = 0.0;
    int i, j, k, n = a->n;
    for (j = 0; j < n; j++) {
        for (i = j; i < n; i++) {
            double sum = i == j ? shift : 0.0;
            for (k = 0; k < 6; k++) sum += p->J[i][k] * p->J[j][k];
            for (k = 0; k < j; k++) sum -= L[i][k] * L[j][k];
            if (i > j) {
                L[i][j] = sum * L[j][j];
            } else {
                if (sum > most) most = sum;
                if (!(sum > WEAK * most)) return 0;
                L[j][j] = 1.0 / sqrt(sum);
            }
        }
        dx[j] = 0.0;
        for (k = 0; k < 6; k++) dx[j] += p->J[j][k] * p->gap[k];
        for (k = 0; k < j; k++) dx[j] -= L[j][k] * dx[k];
        dx[j] *= L[j][j];
    }
    for (j = n - 1; j >= 0; j--) {
        for (k = j + 1; k < n; k++) dx[j] -= L[k][j] * dx[k];
        dx[j] *= L[j][j];
    }
    return 1;
}

/* Reflects columns j .. n so that column j is zero below its element j. */
static void reflect_rows(double A[ARM_JOINTS + 1][ROWS], int j, int n, int rows) {
    double size = 0.0, scale;
    int i, k;
    for (i = j; i < rows; i++) size += A[j][i] * A[j][i];
    if (size == 0.0) return;
    size = A[j][j] > 0.0 ? -sqrt(size) : sqrt(size);
    A[j][j] -= size;
    scale = 1.0 / (size * A[j][j]);
    for (k = j + 1; k <= n; k++) {
        double sum = 0.0;
        for (i = j; i < rows; i++) sum += A[j][i] * A[k][i];
        for (i = j; i < rows; i++) A[k][i] += scale * sum * A[j][i];
    }
    A[j][j] = size;
}

/* Sets columns 0 .. n of A, with `rows` elements each, to zero. */
static void clear_columns(double A[ARM_JOINTS + 1][ROWS], int n, int rows) {
    int j;
    for (j = 0; j <= n; j++) memset(A[j], 0, (size_t)rows * sizeof **A);
}

/* Step of normal_step by reflections of [J gap; sqrt(shift) 0], not squaring J. */
static void orthogonal_step(const arm *a, const configuration *p, double shift, double *dx) {
    double A[ARM_JOINTS + 1][ROWS];
    int j, k, n = a->n, rows = 6 + a->n;
    clear_columns(A, n, rows);
    for (j = 0; j < n; j++) {
        memcpy(A[j], p->J[j], sizeof p->J[j]);
        A[j][6 + j] = sqrt(shift);
    }
    memcpy(A[n], p->gap, sizeof p->gap);
    for (j = 0; j < n; j++) reflect_rows(A, j, n, rows);
    for (j = n - 1; j >= 0; j--) {
        dx[j] = A[n][j];
        for (k = j + 1; k < n; k++) dx[j] -= A[k][j] * dx[k];
        dx[j] /= A[j][j];
    }
}

/* Least-squares solution of [J; held] dx = [right; value] by damped reflections. */
static void held_step(const arm *a, const configuration *p, const double *right, const double *held,
                      double value, double damping, double *dx) {
    double A[ARM_JOINTS + 1][ROWS];
    int j, k, n = a->n;
    clear_columns(A, n, 7 + n);
    for (j = 0; j < n; j++) {
        memcpy(A[j], p->J[j], sizeof p->J[j]);
        A[j][6] = held[j];
        A[j][7 + j] = damping;
    }
    memcpy(A[n], right, 6 * sizeof(double));
    A[n][6] = value;
    for (j = 0; j < n; j++) reflect_rows(A, j, n, 7 + n);
    for (j = n - 1; j >= 0; j--) {
        dx[j] = A[n][j];
        for (k = j + 1; k < n; k++) dx[j] -= A[k][j] * dx[k];
        dx[j] /= A[j][j];
    }
}

void arm_correct(const arm *a, const double *target, const double *held, double value,
                 int iterations, double *x) {
    configuration p;
    double dx[ARM_JOINTS];
    int k, step;
    for (step = 0; step < iterations; step++) {
        double rest = value, size = 0.0, part;
        for (k = 0; k < a->n; k++) {
            rest -= held[k] * x[k];
            p.q[k] = arm_unit(a, k) * x[k];
        }
        arm_examine(a, target, &p);
        held_step(a, &p, p.gap, held, rest, DEPENDENT, dx);
        for (k = 0; k < a->n; k++) size += dx[k] * dx[k];
        size = sqrt(size);
        part = size > LONGEST ? LONGEST / size : 1.0;
        for (k = 0; k < a->n; k++) x[k] += part * dx[k];
        if (!(size >= SETTLED)) return;
    }
}

void arm_reach_sphere(const arm *a, const double *target, const double *centre, double radius,
                      double *x) {
    enum { STEPS = 60 };
    configuration p;
    double dx[ARM_JOINTS], away[ARM_JOINTS];
    int k, step;
    for (step = 0; step < STEPS; step++) {
        double rest = 0.5 * radius, size = 0.0, part;
        for (k = 0; k < a->n; k++) {
            away[k] = (x[k] - centre[k]) / radius;
            rest -= 0.5 * radius * away[k] * away[k];
            p.q[k] = arm_unit(a, k) * x[k];
        }
        arm_examine(a, target, &p);
        held_step(a, &p, p.gap, away, rest, DEPENDENT_THERE, dx);
        for (k = 0; k < a->n; k++) size += dx[k] * dx[k];
        size = sqrt(size);
        /* step short relative to the sphere, to stay near the same solution */
        part = size > 0.3 * radius ? 0.3 * radius / size : 1.0;
        for (k = 0; k < a->n; k++) x[k] += part * dx[k];
        if (!(size >= FINISHED)) return;
    }
}

/* Unit vector `along` in the null space of p->J that is nearest to the unit vector `before`.
 * Returns the cosine between them. One damped projection keeps parts along singular values of a few
 * times ZERO; three projections remove them. */
static double null_direction(const arm *a, const configuration *p, const double *before,
                             double *along) {
    static const double none[6] = {0.0};
    double found[ARM_JOINTS], cosine = 0.0;
    int k, pass;
    memcpy(found, before, (size_t)a->n * sizeof(double));
    for (pass = 0; pass < 3; pass++) {
        double size = 0.0;
        held_step(a, p, none, found, 1.0, ZERO, found);
        for (k = 0; k < a->n; k++) size += found[k] * found[k];
        for (k = 0; k < a->n; k++) found[k] /= sqrt(size);
    }
    for (k = 0; k < a->n; k++) cosine += found[k] * before[k];
    memcpy(along, found, (size_t)a->n * sizeof(double));
    return cosine;
}

/* Computes the Jacobian at x = q / unit. */
static void differentiate(const arm *a, const double *x, configuration *p) {
    static const double home[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    int k;
    for (k = 0; k < a->n; k++) p->q[k] = arm_unit(a, k) * x[k];
    arm_examine(a, home, p);
}

static void transpose(const configuration *p, configuration *turned) {
    int i, k;
    for (i = 0; i < 6; i++)
        for (k = 0; k < 6; k++) turned->J[k][i] = p->J[i][k];
}

/* Direction `along` of a self-motion at x, continued from `before`. Returns 0 and keeps `before` if
 * the direction has changed by 84 degrees. */
static int turn(const arm *a, const double *x, const double *before, double *along) {
    configuration p;
    differentiate(a, x, &p);
    if (null_direction(a, &p, before, along) > 0.1) return 1;
    memcpy(along, before, (size_t)a->n * sizeof(double));
    return 0;
}

/* Orientation of a curve at x: sign of det [[J, left], [along', 0]]. `left` is the direction of
 * equations that the joints do not change; it is continued. The sign changes only at a crossing of
 * two curves (Allgower and Georg 1990, chapter 8). Returns 0 for fewer than six joints. */
static int side(const arm *a, const double *x, const double *along, double *left) {
    configuration p, turned;
    double B[7][7];
    int i, j, k, sign = 1;
    if (a->n != 6) return 0;
    differentiate(a, x, &p);
    transpose(&p, &turned);
    null_direction(a, &turned, left, left);
    for (i = 0; i < 6; i++) {
        for (k = 0; k < 6; k++) B[i][k] = p.J[k][i];
        B[i][6] = left[i];
        B[6][i] = along[i];
    }
    B[6][6] = 0.0;
    for (k = 0; k < 7; k++) { /* elimination with row exchange */
        int best = k;
        for (i = k + 1; i < 7; i++)
            if (fabs(B[i][k]) > fabs(B[best][k])) best = i;
        if (best != k) sign = -sign;
        for (j = k; j < 7; j++) {
            double swap = B[k][j];
            B[k][j] = B[best][j];
            B[best][j] = swap;
        }
        if (B[k][k] == 0.0) return 0;
        if (B[k][k] < 0.0) sign = -sign;
        for (i = k + 1; i < 7; i++)
            for (j = 6; j >= k; j--) B[i][j] -= B[i][k] / B[k][k] * B[k][j];
    }
    return sign;
}

/* Direction `left` of equations that the joints do not change at x: best of six guesses. */
static void left_direction(const arm *a, const double *x, double *left) {
    configuration p, turned;
    double most = 0.0;
    int k;
    differentiate(a, x, &p);
    transpose(&p, &turned);
    for (k = 0; k < 6; k++) {
        double guess[ARM_JOINTS] = {0.0}, found[ARM_JOINTS], cosine;
        guess[k] = 1.0;
        cosine = null_direction(a, &turned, guess, found);
        if (!(cosine > most)) continue;
        most = cosine;
        memcpy(left, found, 6 * sizeof(double));
    }
}

long long arm_walk(const arm *a, const double *target, const double *tangent, double limit,
                   long long most, int sided, double *points, int *closed) {
    /* steps [rad or arm lengths]; without `sided`, crossing curves are not distinguished */
    const double longest = 0.1, shortest = sided ? 1e-5 : 1e-3;
    double along[ARM_JOINTS], x[ARM_JOINTS], moved[ARM_JOINTS], q[ARM_JOINTS], T[16];
    double step = longest;
    long long count = 1;
    double left[ARM_JOINTS] = {0.0}, beyond[ARM_JOINTS], on[ARM_JOINTS];
    int k, n = a->n, seen = 0, sharp;
    const int told = sided && n == 6; /* whether the orientation of the curve is tracked */
    *closed = 0;
    memcpy(along, tangent, (size_t)n * sizeof(double));
    if (told) {
        left_direction(a, points, left);
        seen = side(a, points, along, left);
    }
    while (count < most && step > shortest) {
        const double *last = points + (count - 1) * n;
        double value = 0.0, far = 0.0, away = 0.0, ahead = 0.0, cosine = 0.0;
        for (k = 0; k < n; k++) {
            x[k] = last[k] + step * along[k];
            value += along[k] * x[k];
        }
        arm_correct(a, target, along, value, 12, x);
        for (k = 0; k < n; k++) {
            moved[k] = x[k] - last[k];
            far += moved[k] * moved[k];
            q[k] = arm_unit(a, k) * x[k];
        }
        far = sqrt(far);
        arm_pose(a, q, T);
        if (!(far <= 1.5 * step && far > 0.0 && arm_residual(target, T) <= limit)) {
            step *= 0.5;
            continue;
        }
        for (k = 0; k < n; k++) moved[k] /= far;
        sharp = !turn(a, x, moved, on);
        for (k = 0; k < n; k++) cosine += on[k] * along[k];
        sharp = sided && (sharp || cosine < STRAIGHT);
        memcpy(beyond, left, sizeof beyond);
        k = told ? side(a, x, on, beyond) : 0;
        /* a step onto another close curve changes the orientation if it is straight, and the
         * direction if it is to a side */
        if ((sharp || k != seen) && step > 2.0 * shortest) {
            step *= 0.5;
            continue;
        }
        seen = k;
        memcpy(left, beyond, sizeof left);
        memcpy(along, on, (size_t)n * sizeof(double));
        memcpy(points + count * n, x, (size_t)n * sizeof(double));
        count++;
        step = fmin(2.0 * step, longest);
        for (k = 0; k < n; k++) { /* vector back to the start */
            moved[k] = points[k] - x[k];
            if (!a->prismatic[k]) moved[k] = remainder(moved[k], 2.0 * PI);
            away += moved[k] * moved[k];
            ahead += moved[k] * along[k];
        }
        /* the start is within the next step, with 10 % for the curvature */
        if (count > 3 && sqrt(away) <= 1.1 * step && ahead > 0.0 && ahead <= step) {
            for (k = 0; k < n; k++) points[count * n + k] = x[k] + moved[k];
            *closed = 1;
            return count + 1;
        }
    }
    return count;
}

/* Configuration after a damped Gauss-Newton step. */
static void attempt(const arm *a, const double *target, const configuration *from, double damping,
                    configuration *to) {
    double dx[ARM_JOINTS], shift = damping * from->cost + LEAST;
    int k;
    if (!normal_step(a, from, shift, dx)) orthogonal_step(a, from, shift, dx);
    for (k = 0; k < a->n; k++) to->q[k] = from->q[k] + arm_unit(a, k) * dx[k];
    arm_examine(a, target, to);
}

/* The damping is proportional to the cost, so that the last steps are Newton steps, even if the
 * Jacobian loses rank (Yamashita and Fukushima 2001). */
void arm_descend(const arm *a, const double *target, configuration *p) {
    double damping = 0.1;
    int stalls = 0, step;
    configuration next;
    arm_examine(a, target, p);
    for (step = 0; step < ARM_STEPS && p->cost > FINEST && stalls < STALLS; step++) {
        double gain;
        attempt(a, target, p, damping, &next);
        if (!(next.cost < p->cost)) {
            damping = damping < 1e-3 ? 1e-2 : 4.0 * damping;
            stalls += p->cost < SOLUTION || damping * p->cost > 1e12;
            continue;
        }
        gain = 1.0 - next.cost / p->cost;
        damping *= gain > 0.5 ? 0.2 : gain > 0.1 ? 0.5 : 2.0;
        stalls = gain < 5e-2 ? stalls + 1 : 0;
        configuration_copy(a, p, &next);
    }
}

double arm_polish(const arm *a, const double *target, double *q) {
    double before, after, T[16];
    configuration p;
    memcpy(p.q, q, (size_t)a->n * sizeof(double));
    arm_pose(a, q, T);
    before = arm_residual(target, T);
    arm_descend(a, target, &p);
    arm_wrap(a, p.q);
    arm_pose(a, p.q, T);
    after = arm_residual(target, T);
    if (!(after < before)) return before;
    memcpy(q, p.q, (size_t)a->n * sizeof(double));
    return after;
}
