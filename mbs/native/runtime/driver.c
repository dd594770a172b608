/* Integration of generated functions, as Python calls it.
 *
 * Compiled with mbs_rhs(t, x, p) -> xdot and, when MBS_PROJECT is defined,
 * mbs_project(x, p) -> (x, residual), which is one Newton step onto the constraints.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dopri5.h"

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

#define TOLERANCE 1e-12
#define ITERATIONS 10

typedef long long integer;

int mbs_rhs(const double **arg, double **res, integer *iw, double *w, int mem);
int mbs_rhs_work(integer *arg, integer *res, integer *iw, integer *w);
#ifdef MBS_PROJECT
int mbs_project(const double **arg, double **res, integer *iw, double *w, int mem);
int mbs_project_work(integer *arg, integer *res, integer *iw, integer *w);
#endif

typedef struct {
    dopri5 solver;
    double *p, *memory, *work, *w, *moved;
    const double **arg;
    double **res;
    integer *iw;
} driver;

static int rhs(void *user, double t, const double *x, double *xdot) {
    driver *d = user;
    d->arg[0] = &t;
    d->arg[1] = x;
    d->arg[2] = d->p;
    d->res[0] = xdot;
    return mbs_rhs(d->arg, d->res, d->iw, d->w, 0);
}

#ifdef MBS_PROJECT
static int project(void *user, double t, double *x) {
    driver *d = user;
    int k, i, n = d->solver.n;
    (void)t;
    for (k = 0; k < ITERATIONS; k++) {
        double residual = 0.0, scale = 1.0;
        d->arg[0] = x;
        d->arg[1] = d->p;
        d->res[0] = d->moved;
        d->res[1] = &residual;
        if (mbs_project(d->arg, d->res, d->iw, d->w, 0) || !isfinite(residual)) return 1;
        memcpy(x, d->moved, sizeof(double) * (size_t)n);
        for (i = 0; i < n; i++) scale = fmax(scale, fabs(x[i]));
        if (residual < TOLERANCE * scale) return 0;
    }
    return 1;
}
#endif

static void *array(size_t count, size_t size) { return calloc(count + 1, size); }

EXPORT void mbs_close(driver *d) {
    if (!d) return;
    free(d->p);
    free(d->memory);
    free(d->work);
    free(d->w);
    free(d->moved);
    free((void *)d->arg);
    free((void *)d->res);
    free(d->iw);
    free(d);
}

static void grow(integer *size, const integer *other) {
    int i;
    for (i = 0; i < 4; i++)
        if (other[i] > size[i]) size[i] = other[i];
}

/* NULL: out of memory. */
EXPORT driver *mbs_open(int n, int n_p, const double *p, double rtol, double atol, double t) {
    driver *d = calloc(1, sizeof *d);
    integer size[4] = {3, 2, 0, 0}, other[4];
    if (!d) return NULL;
    mbs_rhs_work(other, other + 1, other + 2, other + 3);
    grow(size, other);
#ifdef MBS_PROJECT
    mbs_project_work(other, other + 1, other + 2, other + 3);
    grow(size, other);
#endif
    d->p = array(n_p, sizeof *d->p);
    d->memory = array(DOPRI5_MEMORY(n), sizeof *d->memory);
    d->work = array(DOPRI5_WORK(n), sizeof *d->work);
    d->moved = array(n, sizeof *d->moved);
    d->arg = array(size[0], sizeof *d->arg);
    d->res = array(size[1], sizeof *d->res);
    d->iw = array(size[2], sizeof *d->iw);
    d->w = array(size[3], sizeof *d->w);
    if (!d->p || !d->memory || !d->work || !d->moved || !d->arg || !d->res || !d->iw || !d->w) {
        mbs_close(d);
        return NULL;
    }
    memcpy(d->p, p, sizeof *p * (size_t)n_p);
    dopri5_init(&d->solver, n, rhs, d, d->memory, d->work);
    d->solver.rtol = rtol;
    d->solver.atol = atol;
#ifdef MBS_PROJECT
    d->solver.project = project;
#endif
    dopri5_start(&d->solver, t);
    return d;
}

EXPORT int mbs_begin(driver *d, double *x) {
    if (!d->solver.project) return DOPRI5_OK;
    return d->solver.project(d, dopri5_time(&d->solver), x) ? DOPRI5_PROJECTION_FAILED : DOPRI5_OK;
}

EXPORT int mbs_table(driver *d, double *x, const double *times, long long count, double *table,
                     long long *done, long long budget) {
    long filled = (long)*done;
    int status = dopri5_table(&d->solver, x, times, (long)count, table, &filled, (long)budget);
    *done = filled;
    return status;
}

EXPORT double mbs_time(const driver *d) { return dopri5_time(&d->solver); }
EXPORT double mbs_step(const driver *d) { return dopri5_wanted_step(&d->solver); }
