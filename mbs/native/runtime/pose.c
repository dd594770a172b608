#include "pose.h"

#include <math.h>
#include <string.h>

#include "rigid.h"

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

static const double SKEWED = 1e-6;     /* by how much an element may miss a rigid transform */
static const double SOLVED = 1e-12;    /* residual of a solution, of max(1 m, the length) */
static const double EXACT = 1e-14;     /* one that polishing hardly betters, likewise */
static const double DOUBTFUL = 1e-6;   /* one beside which a solution may stand, likewise */
static const double FOLD = 1e-9;       /* radicand below zero of a root real but for rounding */
static const double DEGENERATE = 1e-12; /* squared, of a step that leaves a joint undetermined */
static const double SAME = 1e-9;       /* between configurations that are one [rad or lengths] */
static const double MEETING = 1e-5;    /* between those near a double root, likewise */

/* Source: Higham 2008, chapter 8, the Newton-Schulz iteration for the polar factor. */
int pose_round(double *T) {
    double R[9], G[9], before[9], skew = 0.0, worst = 0.0, det;
    int i, j, k, round;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) before[3 * i + j] = R[3 * i + j] = T[4 * i + j];
    for (i = 0; i < 3; i++) { /* R'R */
        for (j = 0; j < 3; j++) {
            double sum = i == j ? -1.0 : 0.0;
            for (k = 0; k < 3; k++) sum += R[3 * k + i] * R[3 * k + j];
            if (!(fabs(sum) <= skew)) skew = fabs(sum);
        }
    }
    for (round = 0; round < 2; round++) {
        double next[9];
        for (i = 0; i < 3; i++)
            for (j = 0; j < 3; j++) {
                G[3 * i + j] = 0.0;
                for (k = 0; k < 3; k++) G[3 * i + j] += R[3 * i + k] * R[3 * j + k];
            }
        for (i = 0; i < 3; i++)
            for (j = 0; j < 3; j++) {
                double sum = 0.0;
                for (k = 0; k < 3; k++) sum += G[3 * i + k] * R[3 * k + j];
                next[3 * i + j] = 1.5 * R[3 * i + j] - 0.5 * sum;
            }
        memcpy(R, next, sizeof R);
    }
    for (k = 0; k < 9; k++)
        if (!(fabs(R[k] - before[k]) <= worst)) worst = fabs(R[k] - before[k]);
    for (k = 0; k < 4; k++)
        if (!(fabs(T[12 + k] - (k == 3)) <= worst)) worst = fabs(T[12 + k] - (k == 3));
    for (i = 0; i < 3; i++)
        if (!(fabs(T[4 * i + 3]) < HUGE_VAL)) return 0;
    det = before[0] * (before[4] * before[8] - before[5] * before[7]) -
          before[1] * (before[3] * before[8] - before[5] * before[6]) +
          before[2] * (before[3] * before[7] - before[4] * before[6]);
    if (!(worst < SKEWED && skew < 10.0 * SKEWED && det > 0.0)) return 0;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) T[4 * i + j] = R[3 * i + j];
    for (k = 0; k < 4; k++) T[12 + k] = k == 3;
    return 1;
}

/* Whether J'J - bound^2 is not positive definite, by Cholesky: a singular value is smaller. */
static int is_near_singular(const arm *a, const configuration *p, double bound) {
    double L[ARM_JOINTS][ARM_JOINTS];
    int i, j, k, n = a->n;
    for (j = 0; j < n; j++) {
        for (i = j; i < n; i++) {
            double sum = i == j ? -bound * bound : 0.0;
            for (k = 0; k < 6; k++) sum += p->J[i][k] * p->J[j][k];
            for (k = 0; k < j; k++) sum -= L[i][k] * L[j][k];
            if (i > j)
                L[i][j] = sum * L[j][j];
            else if (sum > 0.0)
                L[j][j] = 1.0 / sqrt(sum);
            else
                return 1;
        }
    }
    return 0;
}

int pose_is_singular(const arm *a, const double *q, double bound) {
    static const double home[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    configuration p;
    memcpy(p.q, q, (size_t)a->n * sizeof(double));
    arm_examine(a, home, &p);
    return is_near_singular(a, &p, bound);
}

/* The largest difference of a joint between two configurations [rad or arm lengths]. */
static double apart(const arm *a, const double *q, const double *other) {
    double farthest = 0.0;
    int k;
    for (k = 0; k < a->n; k++) {
        double d = other[k] - q[k];
        d = fabs(a->prismatic[k] ? d / a->length : d);
        if (!a->prismatic[k] && d > PI) d = fabs(remainder(d, 2.0 * PI));
        if (d > farthest) farthest = d;
    }
    return farthest;
}

/* Whether a configuration is far enough from all singular ones, and its residual. */
static int is_certain(const arm *a, const double *T, const double *q, double nearly,
                      double *residual) {
    configuration p;
    memcpy(p.q, q, (size_t)a->n * sizeof(double));
    arm_examine(a, T, &p);
    *residual = arm_residual(T, p.T);
    return !is_near_singular(a, &p, nearly);
}

long long pose_settle(const arm *a, const double *T, long long branches, double *q,
                      double *residual, const double *real, const double *regular,
                      double suspect, double nearly, double *number, int *doubtful) {
    const double scale = fmax(1.0, a->length);
    const size_t bytes = (size_t)a->n * sizeof(double);
    long long b, i, count = 0;
    for (b = 0; b < branches; b++) {
        double *own = q + b * a->n, before[ARM_JOINTS];
        int near = !(fabs(real[b]) >= suspect && regular[b] >= suspect);
        if (!(regular[b] >= DEGENERATE)) *doubtful = 1;
        if (!(residual[b] <= DOUBTFUL * scale)) continue;
        memcpy(before, own, bytes);
        if (residual[b] > EXACT * scale) {
            residual[b] = arm_polish(a, T, own);
            near = 1;
        }
        if (!(residual[b] <= SOLVED * scale && real[b] >= -FOLD && apart(a, before, own) <= MEETING)) {
            *doubtful = 1;
            continue;
        }
        if (near && !is_certain(a, T, own, nearly, &residual[b])) *doubtful = 1;
        for (i = 0; i < count; i++) {
            double distance = apart(a, q + i * a->n, own);
            if (distance < SAME) break;
            if (distance < MEETING) *doubtful = 1;
        }
        if (i < count) continue;
        memmove(q + count * a->n, own, bytes);
        arm_wrap(a, q + count * a->n);
        residual[count] = residual[b];
        number[count++] = (double)b;
    }
    return count;
}

/* The branches of the closed form; the number of solutions, -1 where it could not be evaluated. */
static long long by_closed_form(const pose_solver *s, const double *T, double *q, double *residual,
                                double *number, double *w, int *doubtful) {
    const long long branches = s->branches;
    double columns[16];
    const double **in = (const double **)w;
    double **out = (double **)(w + s->arguments);
    long long *integers = (long long *)(w + s->arguments + s->results);
    double *reals = w + s->arguments + s->results + s->integers, *real = reals + s->reals;
    int i, j, memory = s->checkout ? s->checkout() : 0, failed;
    if (memory < 0) return -1;
    for (i = 0; i < 4; i++)
        for (j = 0; j < 4; j++) columns[4 * j + i] = T[4 * i + j];
    in[0] = columns;
    out[0] = q;
    out[1] = residual;
    out[2] = real;
    out[3] = real + branches;
    out[4] = real + 2 * branches; /* the marks, of no use for one pose */
    failed = s->evaluate(in, out, integers, reals, memory);
    if (s->release) s->release(memory);
    return failed ? -1
                  : pose_settle(s->arm, T, branches, q, residual, real, real + branches, s->suspect,
                                s->nearly, number, doubtful);
}

/* The solutions of the general method, in no order. */
static long long by_elimination(const pose_solver *s, const double *T, double *q, double *residual,
                                double *number, double *w, int *doubtful) {
    const arm *a = s->arm;
    arm_configurations found = {q, residual, (long long *)w, 0};
    long long i;
    roth_solve(a, s->loop, T, &found);
    for (i = 0; i < found.count; i++) {
        if (!is_certain(a, T, q + i * a->n, s->nearly, &residual[i])) *doubtful = 1;
        if (!(residual[i] <= SOLVED * fmax(1.0, a->length))) *doubtful = 1;
        number[i] = (double)i;
    }
    return found.count;
}

/* From (count, n) joints of the arm to (count, nq) coordinates, in place. */
static void spread(const pose_solver *s, long long count, double *q) {
    const long long n = s->arm->n, nq = s->nq;
    double own[ARM_JOINTS];
    long long i, k;
    for (i = count - 1; i >= 0; i--) {
        memcpy(own, q + i * n, (size_t)n * sizeof(double));
        memcpy(q + i * nq, s->others, (size_t)nq * sizeof(double));
        for (k = 0; k < n; k++) q[i * nq + s->indices[k]] = own[k];
    }
}

/* T (4, 4) and a pose_solver; gives q (nq, room), residual (room,), number (room,) of the branches,
 * how many they are and what came of the pose. There must be room for all branches, or for
 * ROTH_CONFIGURATIONS. */
EXPORT int mbs_pose(const double **arg, double **res, long long *iw, double *w, int mem) {
    const pose_solver *s = (const pose_solver *)arg[1];
    double T[16];
    long long count;
    int i, j, doubtful = 0;
    (void)iw;
    (void)mem;
    for (i = 0; i < 4; i++)
        for (j = 0; j < 4; j++) T[4 * i + j] = arg[0][4 * j + i];
    res[3][0] = 0.0;
    res[3][1] = POSE_NOT_RIGID;
    if (!pose_round(T)) return 0;
    count = s->loop ? by_elimination(s, T, res[0], res[1], res[2], w, &doubtful)
                    : by_closed_form(s, T, res[0], res[1], res[2], w, &doubtful);
    res[3][1] = count < 0 ? POSE_FAILED : doubtful ? POSE_DOUBTFUL : POSE_CERTAIN;
    if (count < 0) return 0;
    if (s->indices) spread(s, count, res[0]);
    res[3][0] = (double)count;
    return 0;
}

EXPORT int mbs_pose_work(long long *arguments, long long *results, long long *integers,
                         long long *reals) {
    *arguments = 2;
    *results = 4;
    *integers = *reals = 0;
    return 0;
}

/* Which of q (count, n) have a singular value below the bound. */
EXPORT void mbs_singular(const arm *a, double bound, long long count, const double *q,
                         unsigned char *singular) {
    long long i;
    for (i = 0; i < count; i++) singular[i] = (unsigned char)pose_is_singular(a, q + i * a->n, bound);
}

/* `pose_settle` for a closed form that was evaluated elsewhere; gives what came of the pose. */
EXPORT int mbs_settle(const arm *a, const double *T, long long branches, double *q, double *residual,
                      const double *real, const double *regular, double suspect, double nearly, double *number,
                      long long *count) {
    int doubtful = 0;
    *count = pose_settle(a, T, branches, q, residual, real, regular, suspect, nearly,
                         number, &doubtful);
    return doubtful ? POSE_DOUBTFUL : POSE_CERTAIN;
}
