#include "pair.h"

#include <string.h>

static double dot(const double *a, const double *b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double *a, const double *b, double *c) {
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

void pair_of(const double *T, double *w) {
    double p[3], z[3];
    int i;
    for (i = 0; i < 3; i++) {
        p[i] = T[4 * i + 3];
        z[i] = T[4 * i + 2];
    }
    w[0] = 1.0;
    w[1] = dot(p, p);
    w[2] = dot(p, z);
    memcpy(w + 3, p, sizeof p);
    memcpy(w + 6, z, sizeof z);
    cross(p, z, w + 9);
    for (i = 0; i < 3; i++) w[12 + i] = w[1] * z[i] - 2.0 * w[2] * p[i];
}

void pair_carry(const double *T, double *w) {
    double t[3], p[3], z[3], x[3], m[3], t_z[3], t_x[3], tt, tz;
    int i;
    for (i = 0; i < 3; i++) {
        const double *row = T + 4 * i;
        t[i] = row[3];
        p[i] = dot(row, w + 3);
        z[i] = dot(row, w + 6);
        x[i] = dot(row, w + 9);
        m[i] = dot(row, w + 12);
    }
    tt = dot(t, t);
    tz = dot(t, z);
    cross(t, z, t_z);
    cross(t, x, t_x);
    for (i = 0; i < 3; i++) {
        w[3 + i] = p[i] + t[i] * w[0];
        w[6 + i] = z[i];
        w[9 + i] = x[i] + t_z[i];
        w[12 + i] = m[i] - 2.0 * t_x[i] + tt * z[i] - 2.0 * (w[2] + tz) * t[i];
    }
    w[1] += 2.0 * dot(t, p) + tt * w[0];
    w[2] += tz;
}

static void turn_parts(const double *w, double *parts) {
    double *rest = parts, *cosine = parts + PAIR, *sine = cosine + PAIR;
    int k;
    memcpy(rest, w, 3 * sizeof(double));
    for (k = 3; k < PAIR; k += 3) {
        rest[k + 2] = w[k + 2];
        cosine[k] = w[k];
        cosine[k + 1] = w[k + 1];
        sine[k] = -w[k + 1];
        sine[k + 1] = w[k];
    }
}

static void slide_parts(const double *w, double *parts) {
    double *once = parts + PAIR, *twice = once + PAIR;
    memcpy(parts, w, PAIR * sizeof(double));
    once[1] = 2.0 * w[5];
    once[2] = w[8];
    once[5] = w[0];
    once[9] = -w[7];
    once[10] = w[6];
    once[12] = 2.0 * w[10];
    once[13] = -2.0 * w[9];
    once[14] = -2.0 * w[2];
    twice[1] = w[0];
    twice[12] = w[6];
    twice[13] = w[7];
    twice[14] = -w[8];
}

void pair_parts(int prismatic, const double *w, double *parts) {
    memset(parts, 0, 3 * PAIR * sizeof(double));
    if (prismatic)
        slide_parts(w, parts);
    else
        turn_parts(w, parts);
}
