#include <math.h>
#include <string.h>

#include "raghavan_roth.h"
#include "rigid.h"

/* Largest gaps [rad] in a group of angles that may be one root: COARSE for a multiple root, spread
 * by rounding; FINE for a double root, so that close roots are tried separately too. */
static const double COARSE = 1e-3, FINE = 1e-6;
/* Regularity of the matrix below which another loop is tried: angles are accurate to 1e-11 at this
 * value. */
static const double LEAST_REGULARITY = 1e-5;
static const double FAR = 1e3; /* displacement, in reaches, that counts as infinite */

typedef struct {
    const roth_loop *loop;
    double transforms[6][16];
    roth_matrix matrix;
    double reach; /* reach of the arm and of the pose [arm lengths] */
    double *q;    /* (ROTH_CONFIGURATIONS, 6) configurations of the arm found so far */
    int count;
} solution;

/* Adds the configuration of the arm for positions u of the loop's joints, if it is finite. */
static void add_configuration(solution *s, const double *u) {
    const roth_loop *r = s->loop;
    double *q = s->q + 6 * s->count;
    int k;
    if (s->count == ROTH_CONFIGURATIONS) return;
    for (k = 0; k < 6; k++) {
        double value = r->sign * (u[k] + r->offsets[k]);
        if (r->prismatic[k] ? !(fabs(u[k]) < FAR * s->reach) : !(fabs(value) < HUGE_VAL)) return;
        q[r->order[k]] = r->prismatic[k] ? value * r->length : remainder(value, 2.0 * PI);
    }
    s->count++;
}

/* Adds the `count` solutions that share the angle u of joint 3. */
static void add_shared(solution *s, double u, int count) {
    const roth_loop *r = s->loop;
    double x[3][ROTH_SHARED], middle[3], configurations[3][6];
    int i, k, rows;
    count = roth_middle(r, &s->matrix, u, count, x[1], x[2]);
    for (i = 0; i < count; i++) {
        x[0][i] = tan(0.5 * u);
        for (k = 0; k < 3; k++) middle[k] = r->prismatic[2 + k] ? x[k][i] : 2.0 * atan(x[k][i]);
        rows = roth_rest(r, (const double (*)[16])s->transforms, middle, configurations);
        for (k = 0; k < rows; k++) add_configuration(s, configurations[k]);
    }
}

/* End index of a group of ascending angles whose neighbours are not farther apart than the gap. */
static int group_end(const double *u, int start, int count, double gap) {
    int end = start + 1;
    while (end < count && u[end] - u[end - 1] <= gap) end++;
    return end;
}

static double mean(const double *u, int start, int end) {
    double sum = 0.0;
    int i;
    for (i = start; i < end; i++) sum += u[i] - u[start];
    return u[start] + sum / (end - start);
}

/* Rotates the order of angles on the circle so that they start after the widest gap. */
static void begin_after_gap(double *u, int count) {
    double sorted[ROTH_ROOTS], widest = u[0] + 2.0 * PI - u[count - 1];
    int i, start = 0;
    for (i = 1; i < count; i++) {
        if (u[i] - u[i - 1] <= widest) continue;
        widest = u[i] - u[i - 1];
        start = i;
    }
    for (i = 0; i < count; i++)
        sorted[i] = u[(start + i) % count] + (start + i < count ? 0.0 : 2.0 * PI);
    memcpy(u, sorted, (size_t)count * sizeof(double));
}

/* Computes the matrix of a loop at a pose and an offset of the angles. Returns the regularity. */
static double set_loop(solution *s, const roth_loop *r, const double *T, double *offset) {
    s->loop = r;
    roth_transforms(r, T, s->transforms);
    roth_eliminate(r, (const double (*)[16])s->transforms, &s->matrix);
    return roth_regularity(&s->matrix, offset);
}

/* Sets the first loop with a regular matrix at the pose, or else the loop of highest regularity. */
static void choose_loop(solution *s, const roth_loop *r, const double *T, double *offset) {
    const roth_loop *best = r;
    double most = -1.0;
    for (; r; r = r->next) {
        double regularity = set_loop(s, r, T, offset);
        if (regularity > LEAST_REGULARITY) return;
        if (regularity <= most) continue;
        most = regularity;
        best = r;
    }
    if (s->loop != best) set_loop(s, best, T, offset);
}

int roth_candidates(const roth_loop *r, const double *T, double *q) {
    double u[ROTH_ROOTS], offset = 0.0;
    int start, end, first, last, count;
    solution s;
    s.q = q;
    s.count = 0;
    s.reach = 1.0 + sqrt(T[3] * T[3] + T[7] * T[7] + T[11] * T[11]) / r->length;
    choose_loop(&s, r, T, &offset);
    count = roth_roots(&s.matrix, offset, u);
    if (count) begin_after_gap(u, count);
    for (start = 0; start < count; start = end) {
        end = group_end(u, start, count, COARSE);
        add_shared(&s, mean(u, start, end), end - start);
        last = group_end(u, start, end, FINE);
        if (last == end) continue;
        for (first = start; first < end; first = last) {
            last = group_end(u, first, end, FINE);
            add_shared(&s, mean(u, first, last), last - first);
        }
    }
    return s.count;
}

void roth_solve(const arm *a, const roth_loop *r, const double *T, arm_configurations *found) {
    double q[ROTH_CONFIGURATIONS * 6], pose[16];
    int i, count = roth_candidates(r, T, q);
    found->count = 0;
    for (i = 0; i < count; i++) {
        arm_polish(a, T, q + 6 * i);
        arm_pose(a, q + 6 * i, pose);
        if (arm_reaches(a, T, pose)) arm_add(a, T, q + 6 * i, found);
    }
}
