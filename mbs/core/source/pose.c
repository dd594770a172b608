#include "pose.h"

#include <math.h>
#include <string.h>

#include "dense.h"
#include "rigid.h"

static const double SKEWED = 1e-6;      /* largest error of an element of a rigid transform */
static const double SOLVED = 1e-12;     /* largest residual of a solution, times max(1 m, length) */
static const double EXACT = 1e-14;      /* residual that polishing hardly reduces, same unit */
static const double DOUBTFUL = 1e-6;    /* residual with a solution possibly near, same unit */
static const double FOLD = 1e-9;        /* negative radicand of a real root, from rounding */
static const double DEGENERATE = 1e-12; /* squared measure of a step that determines no joint */
static const double EQUAL = 1e-9;       /* distance of equal configurations [rad or arm lengths] */
static const double MEETING = 1e-5;     /* distance near a double root [rad or arm lengths] */
static const double FLAT_PIVOT = 1e-15; /* pivot of a Jacobian that is rounding */

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

/* Largest difference of a joint between two configurations [rad or arm lengths]. */
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

/* Whether a configuration is far enough from all singular ones. Also computes its residual. */
static int is_certain(const arm *a, const double *T, const double *q, double nearly,
                      double *residual) {
    configuration p;
    memcpy(p.q, q, (size_t)a->n * sizeof(double));
    arm_examine(a, T, &p);
    *residual = arm_residual(T, p.T);
    return !is_near_singular(a, &p, nearly);
}

long long pose_settle(const arm *a, const double *T, long long branches, double *q,
                      double *residual, const double *real, const double *regular, double suspect,
                      double nearly, double *number, int *doubtful) {
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
        if (!(residual[b] <= SOLVED * scale && real[b] >= -FOLD &&
              apart(a, before, own) <= MEETING)) {
            *doubtful = 1;
            continue;
        }
        if (near && !is_certain(a, T, own, nearly, &residual[b])) *doubtful = 1;
        for (i = 0; i < count; i++) {
            double distance = apart(a, q + i * a->n, own);
            if (distance < EQUAL) break;
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

/* Solutions by the closed form. Returns their number, or -1 if the evaluation failed. */
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
    out[4] = real + 2 * branches; /* marks, which are not used for a single pose */
    failed = s->evaluate(in, out, integers, reals, memory);
    if (s->release) s->release(memory);
    return failed ? -1
                  : pose_settle(s->robot, T, branches, q, residual, real, real + branches,
                                s->suspect, s->nearly, number, doubtful);
}

/* Solutions by the general method, in any order. Returns their number. */
static long long by_elimination(const pose_solver *s, const double *T, double *q, double *residual,
                                double *number, double *w, int *doubtful) {
    const arm *a = s->robot;
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

/* Expands (count, n) joints of the arm to (count, nq) coordinates, in place. */
static void fill_coordinates(const pose_solver *s, long long count, double *q) {
    const long long n = s->robot->n, nq = s->nq;
    double own[ARM_JOINTS];
    long long i, k;
    for (i = count - 1; i >= 0; i--) {
        memcpy(own, q + i * n, (size_t)n * sizeof(double));
        memcpy(q + i * nq, s->others, (size_t)nq * sizeof(double));
        for (k = 0; k < n; k++) q[i * nq + s->indices[k]] = own[k];
    }
}

/* Converts T (4, 4) of CasADi from column to row order and rounds it; 0 if not rigid. */
static int read_pose(const double *columns, double *T) {
    int i, j;
    for (i = 0; i < 4; i++)
        for (j = 0; j < 4; j++) T[4 * i + j] = columns ? columns[4 * j + i] : 0.0;
    return pose_round(T);
}

int pose_solve(const pose_solver *s, const double *columns, double *q, double *residual,
               double *number, double *w, long long *count) {
    double T[16];
    long long found;
    int doubtful = 0;
    *count = 0;
    if (!read_pose(columns, T)) return POSE_NOT_RIGID;
    found = s->loop ? by_elimination(s, T, q, residual, number, w, &doubtful)
                    : by_closed_form(s, T, q, residual, number, w, &doubtful);
    if (found < 0) return POSE_FAILED;
    if (s->indices) fill_coordinates(s, found, q);
    *count = found;
    return doubtful ? POSE_DOUBTFUL : POSE_CERTAIN;
}

int pose_all(const pose_solver *s, const double **arg, double **res, double *w) {
    const double bound = SOLVED * fmax(1.0, s->robot->length);
    const size_t nq = (size_t)s->nq;
    double *q = w, *residual = q + ROTH_CONFIGURATIONS * nq;
    double *number = residual + ROTH_CONFIGURATIONS, *work = number + ROTH_CONFIGURATIONS;
    long long found, i, count = 0;
    size_t k;
    int certain = pose_solve(s, arg[0], q, residual, number, work, &found) == POSE_CERTAIN;
    for (i = 0; i < found; i++) {
        if (!(residual[i] <= bound)) continue;
        if (count == POSE_COLUMNS) { /* samples of a self-motion */
            certain = 0;
            break;
        }
        if (i > count) memmove(q + (size_t)count * nq, q + (size_t)i * nq, nq * sizeof(double));
        count++;
    }
    for (k = (size_t)count * nq; k < POSE_COLUMNS * nq; k++) q[k] = NAN;
    if (res[0]) memcpy(res[0], q, POSE_COLUMNS * nq * sizeof(double));
    for (i = 0; res[1] && i < POSE_COLUMNS; i++) res[1][i] = i < count;
    if (res[2]) res[2][0] = (double)count;
    if (res[3]) res[3][0] = certain;
    return 0;
}

/* Derivative of the gap (6,), in arm lengths and rad, by element T[r][c]. Changes of R that are no
 * rotation have no effect, see pose_round. */
static void gap_of_element(const arm *a, const double *T, int r, int c, double *gap) {
    int x = (r + 1) % 3, y = (r + 2) % 3;
    memset(gap, 0, 6 * sizeof(double));
    if (c == 3) {
        gap[r] = 1.0 / a->length;
        return;
    }
    gap[3 + x] = 0.5 * T[4 * y + c]; /* half of column c times axis r */
    gap[3 + y] = -0.5 * T[4 * x + c];
}

int pose_all_jacobian(const pose_solver *s, const double **arg, double **res) {
    const arm *a = s->robot;
    const long long nq = s->nq, rows = POSE_COLUMNS * nq;
    double T[16], moves[12 * 6];
    long long b;
    int k, e;
    if (!res[0]) return 0;
    for (b = 0; b < rows * 16; b++) res[0][b] = 0.0;
    if (!arg[1] || !arg[2] || !read_pose(arg[0], T)) return 0;
    for (b = 0; b < POSE_COLUMNS; b++) {
        configuration p;
        dense_qr f;
        if (!(arg[2][b] > 0.0)) continue;
        for (k = 0; k < a->n; k++) p.q[k] = arg[1][b * nq + s->indices[k]];
        arm_examine(a, T, &p);
        for (e = 0; e < 12; e++) gap_of_element(a, T, e / 4, e % 4, moves + 6 * e);
        f.rows = f.columns = f.steps = 6;
        f.A = &p.J[0][0];
        dense_factorize(&f);
        dense_solve(&f, moves, 12, FLAT_PIVOT);
        for (e = 0; e < 12; e++)
            for (k = 0; k < a->n; k++)
                res[0][(4 * (e % 4) + e / 4) * rows + b * nq + s->indices[k]] =
                    arm_unit(a, k) * moves[6 * e + k];
    }
    return 0;
}
