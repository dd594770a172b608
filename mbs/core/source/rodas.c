#include "rodas.h"

#include <math.h>
#include <string.h>

#include "finite.h"

enum { STAGES = 8 };

static const double GAMMA = 0.21193756319429014;

/* Stages 6 and 7 add the previous stage to its state: A[6] = (A[5], 1), A[7] = (A[5], 1, 1). */
static const double A[STAGES][STAGES - 1] = {
    {0},
    {3.0},
    {2.849394379747939, 0.45842242204463923},
    {-6.954028509809101, 2.489845061869568, -10.358996098473584},
    {2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641},
    {-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256,
     0.030198172008377946},
    {-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256,
     0.030198172008377946, 1.0},
    {-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256,
     0.030198172008377946, 1.0, 1.0}};
static const double C[STAGES][STAGES - 1] = {
    {0},
    {-14.155112264123755},
    {-17.97296035885952, -2.859693295451294},
    {147.12150275711716, -1.41221402718213, 71.68940251302358},
    {165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306},
    {24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125,
     -0.6610691825249471},
    {30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783,
     -19.097331116725623, -28.087943162872662},
    {37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047,
     -40.06618937091002, -54.66780262877968, -9.48861652309627}};
static const double TIME[STAGES] = {
    0.0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1.0, 1.0,
    1.0};
static const double TIME_SLOPE[STAGES] = {0.21193756319429014,
                                          -0.42387512638858027,
                                          -0.3384627126235924,
                                          1.8046452872882734,
                                          2.325825639765069,
                                          0.0,
                                          0.0,
                                          0.0};
static const double DENSE[3][STAGES] = {
    {25.948786856663858, -2.5579724845846235, 10.433815404888879, -2.3679251022685204,
     0.524948541321073, 1.1241088310450404, 0.4272876194431874, -0.17202221070155493},
    {-9.91568850695171, -0.9689944594115154, 3.0438037242978453, -24.495224566215796,
     20.176138334709044, 15.98066361424651, -6.789040303419874, -6.710236069923372},
    {11.419903575922262, 2.8879645146136994, 72.92137995996029, 80.12511834622643,
     -52.072871366152654, -59.78993625266729, -0.15582684282751913, 4.883087185713722}};

/* Layout of `work` after the first 2n elements: stages (8n), dense output (5n), d rhs / d t, a
 * slope, pivots (n each), J and its LU factors (n n each). */
static double *part(const stepper *s, int i) { return s->work + (size_t)i * s->n; }
static double *stage(const stepper *s, int i) { return part(s, 2 + i); }
static double *dense(const stepper *s, int i) { return part(s, 10 + i); }
static double *time_slope(const stepper *s) { return part(s, 15); }
static double *stage_slope(const stepper *s) { return part(s, 16); }
static double *pivots(const stepper *s) { return part(s, 17); }
static double *jacobian(const stepper *s) { return part(s, 18); }
static double *factors(const stepper *s) { return part(s, 18 + s->n); }

static double combine(const stepper *s, const double *weight, int count, int row) {
    double sum = 0.0;
    int j;
    for (j = 0; j < count; j++) sum += weight[j] * stage(s, j)[row];
    return sum;
}

static int open(stepper *s, const double *x) {
    int n = s->n;
    if (s->jacobian(s->user, stepper_time(s), x, jacobian(s), time_slope(s)))
        return STEPPER_RHS_FAILED;
    if (!all_finite(jacobian(s), n * n) || !all_finite(time_slope(s), n)) return STEPPER_NOT_FINITE;
    return STEPPER_OK;
}

static void swap_rows(double *a, int n, int i, int k) {
    int j;
    for (j = 0; j < n && i != k; j++) {
        double kept = a[i + (size_t)j * n];
        a[i + (size_t)j * n] = a[k + (size_t)j * n];
        a[k + (size_t)j * n] = kept;
    }
}

/* Factorize a (n, n), stored by columns, in place: LU with row exchanges. Returns 1 if singular. */
static int factorize(double *a, double *pivot, int n) {
    int i, j, k;
    for (k = 0; k < n; k++) {
        double *column = a + (size_t)k * n;
        int best = k;
        for (i = k + 1; i < n; i++)
            if (fabs(column[i]) > fabs(column[best])) best = i;
        if (!(fabs(column[best]) > 0.0)) return 1;
        pivot[k] = best;
        swap_rows(a, n, k, best);
        for (i = k + 1; i < n; i++) column[i] /= column[k];
        for (j = k + 1; j < n; j++) {
            double *other = a + (size_t)j * n, top = other[k];
            if (top == 0.0) continue;
            for (i = k + 1; i < n; i++) other[i] -= column[i] * top;
        }
    }
    return 0;
}

static void solve(const double *a, const double *pivot, int n, double *b) {
    int i, k;
    for (k = 0; k < n; k++) {
        int best = (int)pivot[k];
        double kept = b[best];
        b[best] = b[k];
        b[k] = kept;
    }
    for (k = 0; k < n; k++)
        for (i = k + 1; i < n; i++) b[i] -= a[i + (size_t)k * n] * b[k];
    for (k = n - 1; k >= 0; k--) {
        b[k] /= a[k + (size_t)k * n];
        for (i = 0; i < k; i++) b[i] -= a[i + (size_t)k * n] * b[k];
    }
}

/* Factorize I / (h gamma) - J. Returns a status of the stepper. */
static int shifted(stepper *s, double h) {
    size_t i, n = (size_t)s->n;
    double *a = factors(s);
    for (i = 0; i < n * n; i++) a[i] = -jacobian(s)[i];
    for (i = 0; i < n; i++) a[i + i * n] += 1.0 / (h * GAMMA);
    return factorize(a, pivots(s), s->n) ? STEPPER_NOT_FINITE : STEPPER_OK;
}

static int attempt(stepper *s, const double *x, double h) {
    double t = stepper_time(s), *y = stepper_trial(s);
    int i, k, n = s->n, status = shifted(s, h);
    for (k = 0; k < STAGES && !status; k++) {
        double *u = stage(s, k);
        const double *f = k ? stage_slope(s) : stepper_slope(s);
        for (i = 0; i < n; i++) y[i] = x[i] + combine(s, A[k], k, i);
        if (!all_finite(y, n)) return STEPPER_NOT_FINITE;
        if (k) status = stepper_evaluate(s, t + TIME[k] * h, y, stage_slope(s));
        for (i = 0; i < n; i++)
            u[i] = f[i] + combine(s, C[k], k, i) / h + h * TIME_SLOPE[k] * time_slope(s)[i];
        solve(factors(s), pivots(s), n, u);
    }
    if (status) return status;
    for (i = 0; i < n; i++) stepper_candidate(s)[i] = y[i] + stage(s, STAGES - 1)[i];
    memcpy(y, stage(s, STAGES - 1), sizeof(double) * (size_t)n);
    return all_finite(stepper_candidate(s), n) ? STEPPER_OK : STEPPER_NOT_FINITE;
}

static void keep(stepper *s, const double *x, double h) {
    size_t size = sizeof(double) * (size_t)s->n;
    int i, k;
    (void)h;
    memcpy(dense(s, 0), x, size);
    memcpy(dense(s, 1), stepper_candidate(s), size);
    for (k = 0; k < 3; k++)
        for (i = 0; i < s->n; i++) dense(s, 2 + k)[i] = combine(s, DENSE[k], STAGES, i);
}

static int close(stepper *s, double t) {
    (void)t;
    stepper_close(s, NULL);
    return STEPPER_OK;
}

static void interpolate(const stepper *s, double a, double *row) {
    double b = 1.0 - a;
    int i;
    for (i = 0; i < s->n; i++) {
        double bend = dense(s, 2)[i] + a * (dense(s, 3)[i] + a * dense(s, 4)[i]);
        /* this form keeps constant states, such as modes, bit for bit */
        row[i] = dense(s, 0)[i] + a * ((dense(s, 1)[i] - dense(s, 0)[i]) + b * bend);
    }
}

void rodas_init(stepper *s, int n, stepper_rhs rhs, stepper_jacobian jac, void *user,
                double *memory, double *work) {
    static const stepper_method method = {open, attempt, keep, close, interpolate, NULL};
    stepper_init(s, n, &method, rhs, user, memory, work);
    s->jacobian = jac;
}
