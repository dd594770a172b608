#include "raghavan_roth.h"

#include <math.h>
#include <string.h>

#include "dense.h"
#include "pair.h"
#include "rigid.h"

enum { MONOMIALS = 9, COLUMNS = 3 * MONOMIALS + 1 };

void roth_transforms(const roth_loop *r, const double *T, double transforms[6][16]) {
    double pose[16], target[16], product[16];
    int i;
    memcpy(target, T, sizeof target);
    for (i = 3; i < 12; i += 4) target[i] /= r->length;
    if (r->sign > 0)
        rigid_inverse(target, pose);
    else
        memcpy(pose, target, sizeof pose);
    memcpy(transforms, r->transforms, sizeof r->transforms);
    rigid_product(r->transforms[r->index], pose, product);
    rigid_product(product, r->after, transforms[r->index]);
}

void roth_weights(int parts, double u, double *weights) {
    weights[0] = parts == 2 ? cos(0.5 * u) : 1.0;
    weights[1] = parts == 2 ? sin(0.5 * u) : cos(u);
    weights[2] = parts == 2 ? 0.0 : sin(u);
}

/* Parts of rho(joint) w with 1, x, x^2: times 1 + x^2 for x = tan(q/2), or x = r if prismatic. */
static void half_parts(int prismatic, const double *w, double *parts) {
    int i;
    pair_parts(prismatic, w, parts);
    for (i = 0; i < PAIR && !prismatic; i++) {
        double rest = parts[i], cosine = parts[PAIR + i];
        parts[i] = rest + cosine;
        parts[PAIR + i] = 2.0 * parts[2 * PAIR + i];
        parts[2 * PAIR + i] = rest - cosine;
    }
}

/* Parts of rho(joint 3) w with its weights; for a translation by r = tan(u/2), times
 * cos(u/2) or its square. */
static void third_parts(int prismatic, int count, const double *w, double *parts) {
    int i;
    pair_parts(prismatic, w, parts);
    for (i = 0; i < PAIR && prismatic && count == 3; i++) {
        double low = 0.5 * parts[i], middle = 0.5 * parts[PAIR + i];
        double high = 0.5 * parts[2 * PAIR + i];
        parts[i] = low + high;
        parts[PAIR + i] = low - high;
        parts[2 * PAIR + i] = middle;
    }
}

/* Parts of rho(inverse motion of a joint) w with 1, cos q, sin q or 1, r, r^2. */
static void back_parts(int prismatic, const double *w, double *parts) {
    double *odd = parts + (prismatic ? 1 : 2) * PAIR;
    int i;
    pair_parts(prismatic, w, parts);
    for (i = 0; i < PAIR; i++) odd[i] = -odd[i];
}

/* Coefficients (columns, rows) of the monomials of joints 1 and 2; the first monomial is 1. */
static void right_side(const roth_loop *r, const double transforms[6][16], double *right) {
    double w[PAIR], first[3 * PAIR], second[3 * PAIR], back[16];
    int i, j, k, n1 = r->powers[0], n2 = r->powers[1], rows = r->count - 1;
    rigid_inverse(transforms[5], back);
    pair_of(back, w);
    back_parts(r->prismatic[0], w, first);
    for (j = 0; j < n1; j++) {
        rigid_inverse(transforms[0], back);
        pair_carry(back, first + j * PAIR);
        back_parts(r->prismatic[1], first + j * PAIR, second);
        rigid_inverse(transforms[1], back);
        for (i = 0; i < n2; i++) {
            double *column = right + (i * n1 + j) * rows;
            pair_carry(back, second + i * PAIR);
            for (k = 0; k < rows; k++) column[k] = second[i * PAIR + r->elements[k + 1]];
        }
    }
}

/* Coefficients (weights, monomials, rows) of the monomials x4^i x5^j for each weight of joint 3. */
static void left_side(const roth_loop *r, const double transforms[6][16], double *left) {
    double w[PAIR], fifth[3 * PAIR], fourth[3 * PAIR], third[3 * PAIR];
    int i, j, k, e, n4 = r->powers[3], n5 = r->powers[4], rows = r->count - 1;
    pair_of(transforms[4], w);
    half_parts(r->prismatic[4], w, fifth);
    for (j = 0; j < n5; j++) {
        pair_carry(transforms[3], fifth + j * PAIR);
        half_parts(r->prismatic[3], fifth + j * PAIR, fourth);
        for (i = 0; i < n4; i++) {
            pair_carry(transforms[2], fourth + i * PAIR);
            third_parts(r->prismatic[2], r->powers[2], fourth + i * PAIR, third);
            for (k = 0; k < r->powers[2]; k++) {
                double *column = left + ((k * n4 + i) * n5 + j) * rows;
                for (e = 0; e < rows; e++) column[e] = third[k * PAIR + r->elements[e + 1]];
            }
        }
    }
}

/* Coefficient of the number 1 in a term of the left side. */
static double unit(const roth_loop *r, int weight, int i, int j) {
    double third = weight ? 0.0 : 1.0;
    if (r->prismatic[2] && r->powers[2] == 3) third = weight < 2 ? 0.5 : 0.0;
    if (i == 1 || j == 1) return 0.0;
    return (i == 2 && r->prismatic[3]) || (j == 2 && r->prismatic[4]) ? 0.0 : third;
}

/* A part of the equations, left - unit * constant, and the products of its rows by x4 or x5. */
static void spread(const roth_loop *r, int weight, const double *left, const double *constant,
                   double *rows) {
    int n4 = r->powers[3], n5 = r->powers[4], all = r->count - 1, count = all - r->rank;
    int wide = r->raised ? n5 + 1 : n5, shift = r->raised ? 1 : wide;
    int e, i, j, size = r->size;
    memset(rows, 0, (size_t)(2 * count * size) * sizeof(double));
    for (i = 0; i < n4; i++)
        for (j = 0; j < n5; j++) {
            const double *column = left + ((weight * n4 + i) * n5 + j) * all + r->rank;
            double one = unit(r, weight, i, j);
            for (e = 0; e < count; e++) {
                double value = column[e] - one * constant[r->rank + e];
                rows[e * size + i * wide + j] = value;
                rows[(count + e) * size + i * wide + j + shift] = value;
            }
        }
}

static void mix_rows(const roth_loop *r, const double *rows, double *M) {
    int i, j, k, size = r->size, count = 2 * (r->count - 1 - r->rank);
    if (!r->mix) {
        memcpy(M, rows, (size_t)(size * size) * sizeof(double));
        return;
    }
    memset(M, 0, (size_t)(size * size) * sizeof(double));
    for (i = 0; i < size; i++)
        for (k = 0; k < count; k++) {
            double weight = r->mix[i * count + k];
            for (j = 0; j < size; j++) M[i * size + j] += weight * rows[k * size + j];
        }
}

static void scale_parts(roth_matrix *m) {
    double most = 0.0;
    int i, k, count = m->size * m->size;
    for (k = 0; k < m->parts; k++)
        for (i = 0; i < count; i++) most = fmax(most, fabs(m->M[k][i]));
    for (k = 0; k < m->parts && most > 0.0; k++)
        for (i = 0; i < count; i++) m->M[k][i] /= most;
}

void roth_eliminate(const roth_loop *r, const double transforms[6][16], roth_matrix *m) {
    double right[MONOMIALS * PAIR], left[COLUMNS * PAIR], rows[ROTH_ROWS * ROTH_SIZE];
    int k, all = r->count - 1;
    dense_qr f;
    m->size = r->size;
    m->parts = r->powers[2];
    right_side(r, transforms, right);
    left_side(r, transforms, left);
    f.rows = all;
    f.columns = r->powers[0] * r->powers[1] - 1;
    f.steps = r->rank;
    f.A = right + all;
    dense_factorize(&f);
    dense_turn(&f, right, 1);
    dense_turn(&f, left, m->parts * r->powers[3] * r->powers[4]);
    for (k = 0; k < m->parts; k++) {
        spread(r, k, left, right, rows);
        mix_rows(r, rows, m->M[k]);
    }
    scale_parts(m);
}
