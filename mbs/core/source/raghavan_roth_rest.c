#include <math.h>
#include <string.h>

#include "pair.h"
#include "raghavan_roth.h"
#include "rigid.h"

enum { KEPT = 6 };
static const int REVOLUTE[KEPT] = {1, 2, 5, 8, 11, 14}, PRISMATIC[KEPT] = {3, 4, 6, 7, 8, 11};
static const double FLAT = 1e-4;     /* ratio of singular values below which two roots are added */
static const double NONE = 1e-9;     /* ratio of singular values below which no single root */
static const double NOTHING = 1e-12; /* singular value, in arm lengths, that is rounding */

/* Singular values s of A (KEPT, 2), column by column, and right vectors V; the left vectors replace
 * A. Source: Hestenes 1958, which for two columns is one rotation. */
static void decompose(double A[2][KEPT], double *s, double V[2][2]) {
    double a = 0.0, b = 0.0, c = 0.0, angle, x, y;
    int i, k;
    for (i = 0; i < KEPT; i++) {
        a += A[0][i] * A[0][i];
        b += A[1][i] * A[1][i];
        c += A[0][i] * A[1][i];
    }
    angle = 0.5 * atan2(2.0 * c, a - b);
    x = cos(angle);
    y = sin(angle);
    V[0][0] = x;
    V[0][1] = y;
    V[1][0] = -y;
    V[1][1] = x;
    s[0] = s[1] = 0.0;
    for (i = 0; i < KEPT; i++) {
        double first = A[0][i], second = A[1][i];
        A[0][i] = x * first + y * second;
        A[1][i] = x * second - y * first;
        s[0] += A[0][i] * A[0][i];
        s[1] += A[1][i] * A[1][i];
    }
    for (k = 0; k < 2; k++) {
        s[k] = sqrt(s[k]);
        for (i = 0; i < KEPT && s[k] > 0.0; i++) A[k][i] /= s[k];
    }
}

/* Both roots of x cos q + y sin q = g, or of x r + y r^2 = g; the double root if complex. */
static void crossings(int prismatic, const double *n, double g, double *roots) {
    double size = hypot(n[0], n[1]), middle = atan2(n[1], n[0]), half, larger, root;
    if (!prismatic) {
        half = acos(fmax(-1.0, fmin(1.0, g / fmax(size, 1e-300))));
        roots[0] = middle - half;
        roots[1] = middle + half;
        return;
    }
    root = sqrt(fmax(n[0] * n[0] + 4.0 * n[1] * g, 0.0));
    larger = -0.5 * (n[0] + copysign(root, n[0]));
    roots[0] = -g / (fabs(larger) > 1e-300 ? larger : 1e-300);
    roots[1] = fabs(n[1]) > 1e-9 * fabs(n[0]) ? larger / n[1] : roots[0];
}

/* Equations A (KEPT, 2) (cos q, sin q)' = b or A (r, r^2)' = b of joint 2. */
static void second_equations(const roth_loop *r, const double transforms[6][16],
                             const double *beyond, const double *goal, double A[2][KEPT],
                             double *b) {
    const int *kept = r->prismatic[0] ? PRISMATIC : REVOLUTE;
    double w[PAIR], end[PAIR], parts[3 * PAIR];
    int i, k;
    pair_of(beyond, w);
    pair_of(goal, end);
    pair_parts(r->prismatic[1], w, parts);
    for (k = 0; k < 3; k++) pair_carry(transforms[0], parts + k * PAIR);
    for (i = 0; i < KEPT; i++) {
        A[0][i] = parts[PAIR + kept[i]];
        A[1][i] = parts[2 * PAIR + kept[i]];
        b[i] = end[kept[i]] - parts[kept[i]];
    }
}

/* Positions of joint 2: a single root, and two more for equations of (nearly) rank one. */
static int second_joint(const roth_loop *r, const double transforms[6][16], const double *beyond,
                        const double *goal, double *q2) {
    double A[2][KEPT], V[2][2], b[KEPT], s[2], g[2] = {0.0, 0.0}, f[2];
    int i, k, count = 0, sharp;
    second_equations(r, transforms, beyond, goal, A, b);
    decompose(A, s, V);
    for (k = 0; k < 2; k++) {
        sharp = s[k] > fmax(NONE * s[0], NOTHING);
        for (i = 0; i < KEPT; i++) g[k] += A[k][i] * b[i];
        g[k] = sharp ? g[k] / s[k] : 0.0;
    }
    for (i = 0; i < 2; i++) f[i] = V[0][i] * g[0] + V[1][i] * g[1];
    if (sharp) q2[count++] = r->prismatic[1] ? f[0] : atan2(f[1], f[0]);
    if (s[1] > fmax(FLAT * s[0], NOTHING)) return count;
    crossings(r->prismatic[1], V[0], g[0], q2 + count);
    return count + 2;
}

/* Position of joint 1 that moves the origin and the z axis of `near` to the goal. */
static double first_joint(int prismatic, const double *near, const double *goal) {
    double across, along;
    if (prismatic) return goal[11] - near[11];
    across = near[2] * goal[6] - near[6] * goal[2] + near[3] * goal[7] - near[7] * goal[3];
    along = near[2] * goal[2] + near[6] * goal[6] + near[3] * goal[3] + near[7] * goal[7];
    return atan2(across, along);
}

int roth_rest(const roth_loop *r, const double transforms[6][16], const double *middle,
              double configurations[3][6]) {
    double beyond[16], goal[16], near[16], pose[16], back[16], q2[3];
    int i, k, count;
    memcpy(beyond, transforms[1], sizeof beyond);
    for (k = 2; k < 5; k++) {
        rigid_move(beyond, middle[k - 2], r->prismatic[k]);
        rigid_product(beyond, transforms[k], near);
        memcpy(beyond, near, 12 * sizeof(double));
    }
    rigid_inverse(transforms[5], goal);
    count = second_joint(r, transforms, beyond, goal, q2);
    for (i = 0; i < count; i++) {
        double *q = configurations[i];
        memcpy(pose, transforms[0], sizeof pose);
        rigid_move(pose, q2[i], r->prismatic[1]);
        rigid_product(pose, beyond, near);
        q[0] = first_joint(r->prismatic[0], near, goal);
        q[1] = q2[i];
        memcpy(q + 2, middle, 3 * sizeof(double));
        memcpy(pose, (const double[16]){1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1},
               sizeof pose);
        rigid_move(pose, q[0], r->prismatic[0]);
        rigid_product(pose, near, back);
        rigid_inverse(back, near);
        rigid_product(near, goal, pose);
        q[5] = atan2(pose[4] - pose[1], pose[0] + pose[5]);
    }
    return count;
}
