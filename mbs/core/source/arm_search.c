#include "arm_search.h"

#include <math.h>
#include <string.h>

#include "rigid.h"

static const double SAME = 1e-9, CLOSE = 1e-2, BETWEEN = 1e-14; /* see arm_same */

/* Source: Steele, Lea and Flood 2014, the generator SplitMix64, entered at its `position`. */
static double uniform(unsigned long long seed, unsigned long long position) {
    unsigned long long z = seed + (position + 1) * 0x9E3779B97F4A7C15ULL;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    z ^= z >> 31;
    return (double)(z >> 11) * 0x1p-53;
}

void arm_start(const arm *a, const double *target, unsigned long long seed, long long number,
               double *q) {
    double x = target[3], y = target[7], z = target[11];
    double reach = a->length + sqrt(x * x + y * y + z * z);
    int k;
    for (k = 0; k < a->n; k++) {
        double span = a->prismatic[k] ? reach : PI;
        q[k] = span * (1.0 - 2.0 * uniform(seed, (unsigned long long)(number * a->n + k)));
    }
}

/* From one value of a joint to another, in the joint's unit. */
static double difference(const arm *a, int joint, double from, double to) {
    double d = to - from;
    return a->prismatic[joint] ? d / a->length : remainder(d, 2.0 * PI);
}

static double residual_of(const arm *a, const double *target, const double *q) {
    double T[16];
    arm_pose(a, q, T);
    return arm_relative_residual(a, target, T);
}

int arm_same(const arm *a, const double *target, const double *q, const double *other) {
    double half[ARM_JOINTS], worse, farthest = 0.0;
    int k;
    for (k = 0; k < a->n; k++) {
        double d = difference(a, k, q[k], other[k]);
        if (fabs(d) >= CLOSE) return 0;
        farthest = fmax(farthest, fabs(d));
        half[k] = q[k] + 0.5 * d * arm_unit(a, k);
    }
    if (farthest < SAME) return 1;
    worse = fmax(residual_of(a, target, q), residual_of(a, target, other));
    return residual_of(a, target, half) < fmax(BETWEEN, worse);
}

void arm_add(const arm *a, const double *target, const double *q, arm_configurations *found) {
    double residual = residual_of(a, target, q);
    size_t n = (size_t)a->n;
    long long i;
    for (i = 0; i < found->count; i++)
        if (arm_same(a, target, found->q + i * a->n, q)) break;
    if (i == found->count) {
        found->hits[i] = 0;
        found->residual[i] = HUGE_VAL;
        found->count++;
    }
    found->hits[i]++;
    if (residual >= found->residual[i]) return;
    found->residual[i] = residual;
    memcpy(found->q + i * a->n, q, n * sizeof(double));
}

void arm_search(const arm *a, const double *target, long long starts, unsigned long long seed,
                arm_configurations *found) {
    configuration p;
    long long start;
    found->count = 0;
    for (start = 0; start < starts; start++) {
        arm_start(a, target, seed, start, p.q);
        arm_descend(a, target, &p);
        arm_wrap(a, p.q);
        if (arm_reaches(a, target, p.T)) arm_add(a, target, p.q, found);
    }
}
