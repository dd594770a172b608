#include "rigid.h"

#include <math.h>

void rigid_product(const double *A, const double *B, double *T) {
    int i, j;
    for (i = 0; i < 12; i += 4) {
        for (j = 0; j < 4; j++) T[i + j] = A[i] * B[j] + A[i + 1] * B[4 + j] + A[i + 2] * B[8 + j];
        T[i + 3] += A[i + 3];
    }
}

void rigid_inverse(const double *T, double *back) {
    int i, j;
    for (i = 0; i < 3; i++) {
        for (j = 0; j < 3; j++) back[4 * i + j] = T[4 * j + i];
        back[4 * i + 3] = -(T[i] * T[3] + T[4 + i] * T[7] + T[8 + i] * T[11]);
    }
}

void rigid_move(double *T, double q, int prismatic) {
    double c, s;
    int i;
    if (prismatic) {
        for (i = 0; i < 12; i += 4) T[i + 3] += q * T[i + 2];
        return;
    }
    c = cos(q);
    s = sin(q);
    for (i = 0; i < 12; i += 4) {
        double x = T[i], y = T[i + 1];
        T[i] = c * x + s * y;
        T[i + 1] = c * y - s * x;
    }
}
