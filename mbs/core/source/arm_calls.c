/* Exported functions of the arm algorithms, for callers with plain arrays. */
#include "arm_nearest.h"
#include "arm_reduce.h"
#include "arm_search.h"
#include "pose.h"

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

/* Polishes q (count, n) for target poses (4, 4) `stride` doubles apart; 0: one pose. */
EXPORT void mbs_polish(const arm *a, const double *target, long long stride, long long count,
                       double *q, double *residual) {
    long long i;
    for (i = 0; i < count; i++) residual[i] = arm_polish(a, target + i * stride, q + i * a->n);
}

/* Corrects x (count, n) with held (count, n) and value (count,), see arm_correct. */
EXPORT void mbs_correct(const arm *a, const double *target, long long stride, long long count,
                        const double *held, const double *value, int iterations, double *x) {
    long long i;
    for (i = 0; i < count; i++)
        arm_correct(a, target + i * stride, held + i * a->n, value[i], iterations, x + i * a->n);
}

/* Computes residual (count,) of q (count, n), see arm_residual. */
EXPORT void mbs_residual(const arm *a, const double *target, long long stride, long long count,
                         const double *q, double *residual) {
    double T[16];
    long long i;
    for (i = 0; i < count; i++) {
        arm_pose(a, q + i * a->n, T);
        residual[i] = arm_residual(target + i * stride, T);
    }
}

/* Computes gap (count, 6) and J (count, n, 6) of q (count, n), see arm_examine. */
EXPORT void mbs_examine(const arm *a, const double *target, long long stride, long long count,
                        const double *q, double *gap, double *J) {
    configuration p;
    long long i;
    int k, m;
    for (i = 0; i < count; i++) {
        for (k = 0; k < a->n; k++) p.q[k] = q[i * a->n + k];
        arm_examine(a, target + i * stride, &p);
        for (m = 0; m < 6; m++) gap[6 * i + m] = p.gap[m];
        for (k = 0; k < a->n; k++)
            for (m = 0; m < 6; m++) J[(i * a->n + k) * 6 + m] = p.J[k][m];
    }
}

/* See arm_walk. */
EXPORT long long mbs_walk(const arm *a, const double *target, const double *tangent, double limit,
                          long long most, int sided, double *points, int *closed) {
    return arm_walk(a, target, tangent, limit, most, sided, points, closed);
}

/* Fills q (starts, n), residual and hits (starts,). Returns the number of configurations found. */
EXPORT long long mbs_search(const arm *a, const double *target, long long starts,
                            unsigned long long seed, double *q, double *residual, long long *hits) {
    arm_configurations found = {q, residual, hits, 0};
    arm_search(a, target, starts, seed, &found);
    return found.count;
}

/* Keeps the distinct rows of q (count, n), in their order. Returns their number. */
EXPORT long long mbs_merge(const arm *a, const double *target, long long count, double *q,
                           double *residual, long long *hits) {
    arm_configurations found = {q, residual, hits, 0};
    double own[ARM_JOINTS];
    long long i;
    int k;
    for (i = 0; i < count; i++) {
        for (k = 0; k < a->n; k++) own[k] = q[i * a->n + k];
        arm_add(a, target, own, &found);
    }
    return found.count;
}

EXPORT double mbs_nearest(const arm *a, const double *target, long long starts,
                          unsigned long long seed, double *q) {
    return arm_nearest(a, target, starts, seed, q);
}

/* All solutions for poses (poses, 4, 4): q (room, 6), the index of the pose of each, and the number
 * of candidates that merged to it. Stops if there may be no room for another pose; *done poses are
 * solved. */
EXPORT long long mbs_general(const arm *a, const roth_loop *r, const double *target,
                             long long poses, long long room, double *q, long long *number,
                             long long *hits, long long *done) {
    double residual[ROTH_CONFIGURATIONS];
    long long i, count = 0;
    for (*done = 0; *done < poses && count + ROTH_CONFIGURATIONS <= room; ++*done) {
        arm_configurations found = {q + 6 * count, residual, hits + count, 0};
        roth_solve(a, r, target + 16 * *done, &found);
        for (i = 0; i < found.count; i++) number[count + i] = *done;
        count += found.count;
    }
    return count;
}

/* Exports roth_candidates; q has room for ROTH_CONFIGURATIONS. */
EXPORT long long mbs_candidates(const roth_loop *r, const double *target, double *q) {
    return roth_candidates(r, target, q);
}

/* pose_solve in CasADi's convention: T and a pose_solver -> q, residual, number, (count, code). */
EXPORT int mbs_pose(const double **arg, double **res, long long *iw, double *w, int mem) {
    long long count;
    (void)iw;
    (void)mem;
    res[3][1] = pose_solve((const pose_solver *)arg[1], arg[0], res[0], res[1], res[2], w, &count);
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

/* Marks the rows of q (count, n) whose Jacobian has a singular value below the bound. */
EXPORT void mbs_singular(const arm *a, double bound, long long count, const double *q,
                         unsigned char *singular) {
    long long i;
    for (i = 0; i < count; i++)
        singular[i] = (unsigned char)pose_is_singular(a, q + i * a->n, bound);
}

/* Exports pose_settle for an evaluated closed form. Returns POSE_CERTAIN or POSE_DOUBTFUL. */
EXPORT int mbs_settle(const arm *a, const double *T, long long branches, double *q,
                      double *residual, const double *real, const double *regular, double suspect,
                      double nearly, double *number, long long *count) {
    int doubtful = 0;
    *count =
        pose_settle(a, T, branches, q, residual, real, regular, suspect, nearly, number, &doubtful);
    return doubtful ? POSE_DOUBTFUL : POSE_CERTAIN;
}

/* Exports pose_round. */
EXPORT int mbs_round(double *T) { return pose_round(T); }

/* Moves x (count, n) to a sphere, see arm_reach_sphere. */
EXPORT void mbs_reach_sphere(const arm *a, const double *target, const double *centre,
                             double radius, long long count, double *x) {
    long long i;
    for (i = 0; i < count; i++) arm_reach_sphere(a, target, centre, radius, x + i * a->n);
}

/* x (count, n) and g (count, 6 - n + c) for h (count, c), see arm_reduced; 1 if all converge. */
EXPORT int mbs_reduced(const arm *a, const double *target, const arm_reduction *r, long long count,
                       const double *h, double *x, double *g) {
    long long i;
    int c = r->corank, found = 1;
    for (i = 0; i < count; i++)
        found &= arm_reduced(a, target, r, h + i * c, x + i * a->n, g + i * (6 - a->n + c));
    return found;
}
