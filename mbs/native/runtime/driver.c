/* Integration of generated functions, as Python calls it.
 *
 * Compiled with mbs_rhs(t, x, p) -> xdot and, when these are defined,
 *   MBS_PROJECT  mbs_project(t, x, p) -> (x, residual), one Newton step onto the constraints
 *   MBS_RODAS    mbs_jacobian(t, x, p) -> (d rhs / d x, d rhs / d t); else Dormand and Prince
 *   MBS_EVENTS   mbs_indicators(t, x, p) and mbs_rates(t, x, p), as many values each, and
 *                mbs_jump(t, x, p, fired) -> (x, modes); the modes are the last of p
 *   MBS_APPROACHES  mbs_approaches(t, x, p) -> three columns, as many values each, as events.h has
 *                them
 *   MBS_PASSAGE  mbs_rows, mbs_forces and mbs_regularity, as passage.h has them
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dopri5.h"
#ifdef MBS_RODAS
#include "rodas.h"
#endif
#ifdef MBS_EVENTS
#include "events.h"
#endif

#ifdef MBS_PASSAGE
#include "passage.h"
#endif

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

#define TOLERANCE 1e-12
#define ITERATIONS 10

typedef long long integer;

#define GENERATED(f)                                                               \
    int f(const double **arg, double **res, integer *iw, double *w, int mem);      \
    int f##_work(integer *arg, integer *res, integer *iw, integer *w)

GENERATED(mbs_rhs);
#ifdef MBS_PROJECT
GENERATED(mbs_project);
#endif
#ifdef MBS_RODAS
GENERATED(mbs_jacobian);
#endif
#ifdef MBS_EVENTS
GENERATED(mbs_indicators);
GENERATED(mbs_rates);
GENERATED(mbs_jump);
#endif
#ifdef MBS_APPROACHES
GENERATED(mbs_approaches);
#endif
#ifdef MBS_PASSAGE
GENERATED(mbs_rows);
GENERATED(mbs_forces);
GENERATED(mbs_regularity);
#endif

typedef struct {
    stepper solver;
    double *p, *memory, *work, *w, *projected;
    const double **arg;
    double **res;
    integer *iw;
    int n_p;
#ifdef MBS_EVENTS
    events events;
    double *event_work;
    int n_modes;
#endif
#ifdef MBS_PASSAGE
    passage *passage;
    double *passage_memory;
#endif
} driver;

typedef int (*work_of)(integer *, integer *, integer *, integer *);
typedef int (*value_of)(const double **, double **, integer *, double *, int);

static int call(driver *d, value_of f, double t, const double *x, double *first, double *second) {
    t = stepper_law_time(&d->solver, t);
    d->arg[0] = &t;
    d->arg[1] = x;
    d->arg[2] = d->p;
    d->res[0] = first;
    d->res[1] = second;
    return f(d->arg, d->res, d->iw, d->w, 0);
}

static int rhs(void *user, double t, const double *x, double *xdot) {
    return call(user, mbs_rhs, t, x, xdot, NULL);
}

#ifdef MBS_PROJECT
static int project(void *user, double t, double *x) {
    driver *d = user;
    int k, i, n = d->solver.n;
#ifdef MBS_PASSAGE
    if (d->passage && !passage_project(d->passage, t, x)) return 0;
#endif
    for (k = 0; k < ITERATIONS; k++) {
        double residual = 0.0, scale = 1.0;
        if (call(d, mbs_project, t, x, d->projected, &residual) || !isfinite(residual)) return 1;
        for (i = 0; i < n; i++) scale = fmax(scale, fabs(x[i]));
        if (stepper_all_finite(d->projected, n))
            memcpy(x, d->projected, sizeof(double) * (size_t)n);
        else if (!(residual < TOLERANCE * scale)) /* else x is on the rows, where they depend */
            return 1;
        if (residual < TOLERANCE * scale) return 0;
    }
    return 1;
}
#endif

#ifdef MBS_RODAS
static int jacobian(void *user, double t, const double *x, double *J, double *f_t) {
    return call(user, mbs_jacobian, t, x, J, f_t);
}
#endif

#ifdef MBS_EVENTS
static int indicators(void *user, double t, const double *x, double *values) {
    return call(user, mbs_indicators, t, x, values, NULL);
}

static int rates(void *user, double t, const double *x, double *values) {
    return call(user, mbs_rates, t, x, values, NULL);
}

#ifdef MBS_APPROACHES
static int approaches(void *user, double t, const double *x, double *values) {
    return call(user, mbs_approaches, t, x, values, NULL);
}
#define APPROACHES approaches
#else
#define APPROACHES NULL
#endif

static int jump(void *user, double t, double *x, const double *fired) {
    driver *d = user;
    double *modes = d->p + d->n_p - d->n_modes, *next = d->event_work;
    int i;
    d->arg[3] = fired;
    if (call(d, mbs_jump, t, x, d->projected, next)) return 1;
    for (i = 0; i < d->n_modes; i++)
        if (!isfinite(next[i])) return 1;
    memcpy(x, d->projected, sizeof(double) * (size_t)d->solver.n);
    memcpy(modes, next, sizeof(double) * (size_t)d->n_modes);
    return 0;
}
#endif

#ifdef MBS_PASSAGE
static int rows(void *user, double t, const double *x, const passage_rows *r) {
    driver *d = user;
    double *const to[] = {r->position, r->slope, r->J, r->b, r->c, r->N, r->bend, r->rank};
    t = stepper_law_time(&d->solver, t);
    d->arg[0] = &t;
    d->arg[1] = x;
    d->arg[2] = d->p;
    memcpy(d->res, to, sizeof to);
    return mbs_rows(d->arg, d->res, d->iw, d->w, 0);
}

static int forces(void *user, double t, const double *x, double *M, double *f, double *rate) {
    ((driver *)user)->res[2] = rate;
    return call(user, mbs_forces, t, x, M, f);
}

static int regularity(void *user, double t, const double *x, double *value) {
    return call(user, mbs_regularity, t, x, value, NULL);
}

/* Before mbs_begin; size as passage_size, the four patterns as passage_patterns. 1: out of memory. */
EXPORT int mbs_pass(driver *d, const int *size, const int *const *given, double typical) {
    passage_size z = {size[0], size[1], size[2], size[3], size[4], size[5], size[6]};
    passage_patterns patterns = {given[0], given[1], given[2], given[3]};
    passage_model model = {rows, forces, regularity, typical};
    d->passage_memory = calloc((size_t)PASSAGE_MEMORY(d->solver.n), sizeof(double));
    if (!d->passage_memory) return 1;
    d->passage = passage_new(&d->solver, &z, &patterns, &model, d->passage_memory);
    return d->passage == NULL;
}

/* After mbs_begin; 1 where x is a singular configuration that is left on one branch: its slope. */
EXPORT int mbs_leaves(driver *d, const double *x, double *slope) {
    double t = stepper_time(&d->solver);
    return passage_singular(d->passage, t, x) && !passage_slope(d->passage, t, x, slope, NULL);
}
#endif

static void *array(size_t count, size_t size) { return calloc(count + 1, size); }

EXPORT void mbs_close(driver *d) {
    if (!d) return;
    free(d->p);
    free(d->memory);
    free(d->work);
    free(d->w);
    free(d->projected);
    free((void *)d->arg);
    free((void *)d->res);
    free(d->iw);
#ifdef MBS_EVENTS
    free(d->event_work);
#endif
#ifdef MBS_PASSAGE
    passage_free(d->passage);
    free(d->passage_memory);
#endif
    free(d);
}

/* The largest scratch that any of the functions asks for. */
static void sizes(integer *size) {
    static const work_of works[] = {
        mbs_rhs_work,
#ifdef MBS_PROJECT
        mbs_project_work,
#endif
#ifdef MBS_RODAS
        mbs_jacobian_work,
#endif
#ifdef MBS_EVENTS
        mbs_indicators_work, mbs_rates_work,    mbs_jump_work,
#endif
#ifdef MBS_APPROACHES
        mbs_approaches_work,
#endif
#ifdef MBS_PASSAGE
        mbs_rows_work,       mbs_forces_work,   mbs_regularity_work,
#endif
    };
    size_t k;
    int i;
    for (k = 0; k < sizeof works / sizeof *works; k++) {
        integer other[4];
        works[k](other, other + 1, other + 2, other + 3);
        for (i = 0; i < 4; i++)
            if (other[i] > size[i]) size[i] = other[i];
    }
}

static void begin(driver *d, int n) {
#ifdef MBS_RODAS
    rodas_init(&d->solver, n, rhs, jacobian, d, d->memory, d->work);
#else
    dopri5_init(&d->solver, n, rhs, d, d->memory, d->work);
#endif
#ifdef MBS_PROJECT
    d->solver.project = project;
#endif
}

static size_t work_size(size_t n) {
#ifdef MBS_RODAS
    return RODAS_WORK(n);
#else
    return DOPRI5_WORK(n);
#endif
}

/* control: rtol, atol, the longest step. NULL: out of memory. */
EXPORT driver *mbs_open(int n, int n_p, const double *p, const double *control, double t) {
    driver *d = calloc(1, sizeof *d);
    integer size[4] = {4, 8, 0, 0};
    if (!d) return NULL;
    sizes(size);
    d->n_p = n_p;
    d->p = array(n_p, sizeof *d->p);
    d->memory = array(STEPPER_MEMORY(n), sizeof *d->memory);
    d->work = array(work_size(n), sizeof *d->work);
    d->projected = array(n, sizeof *d->projected);
    d->arg = array(size[0], sizeof *d->arg);
    d->res = array(size[1], sizeof *d->res);
    d->iw = array(size[2], sizeof *d->iw);
    d->w = array(size[3], sizeof *d->w);
    if (!d->p || !d->memory || !d->work || !d->projected || !d->arg || !d->res || !d->iw || !d->w) {
        mbs_close(d);
        return NULL;
    }
    memcpy(d->p, p, sizeof *p * (size_t)n_p);
    begin(d, n);
    d->solver.rtol = control[0];
    d->solver.atol = control[1];
    d->solver.h_max = control[2];
    d->solver.afresh = control[3];
    stepper_start(&d->solver, t);
    return d;
}

EXPORT int mbs_begin(driver *d, double *x) {
    double t = stepper_time(&d->solver);
    if (d->solver.project && d->solver.project(d, t, x)) return STEPPER_PROJECTION_FAILED;
#ifdef MBS_EVENTS
    return events_start(&d->events, x);
#else
    return STEPPER_OK;
#endif
}

EXPORT int mbs_table(driver *d, double *x, const double *times, long long count, double *table,
                     long long *done, long long budget) {
    long filled = (long)*done;
#ifdef MBS_EVENTS
    int status =
        events_table(&d->events, x, times, (long)count, table, &filled, (long)budget);
#else
    int status =
        stepper_table(&d->solver, x, times, (long)count, table, &filled, (long)budget);
#endif
    *done = filled;
    return status;
}

/* Before mbs_begin: steps end at these times; hard: 1 where laws of time may jump. The arrays stay
 * with the caller. */
EXPORT void mbs_stops(driver *d, const double *stops, const double *hard, long long count) {
    stepper_stop_at(&d->solver, stops, hard, (long)count);
}

/* Before mbs_begin: factors of atol, (n,), which stay with the caller. */
EXPORT void mbs_sizes(driver *d, const double *absolute, const double *relative) {
    d->solver.nominal = absolute;
    d->solver.relative = relative;
}

EXPORT double mbs_time(const driver *d) { return stepper_time(&d->solver); }
EXPORT double mbs_step(const driver *d) { return stepper_wanted_step(&d->solver); }

#ifdef MBS_EVENTS
/* Before mbs_begin. 1: out of memory. */
EXPORT int mbs_watch(driver *d, int count, int n_modes) {
    static const events_model model = {indicators, rates, jump, APPROACHES};
    size_t memory = (size_t)EVENTS_MEMORY(count), work = (size_t)EVENTS_WORK(d->solver.n, count);
    double *first;
    d->event_work = array((size_t)n_modes + memory + work, sizeof *d->event_work);
    if (!d->event_work) return 1;
    d->n_modes = n_modes;
    first = d->event_work + n_modes;
    events_init(&d->events, &d->solver, count, &model, first, first + memory);
    return 0;
}

/* The last event: which indicators fired, and the modes after it. */
EXPORT void mbs_event(const driver *d, double *fired, double *modes) {
    memcpy(fired, events_fired(&d->events), sizeof *fired * (size_t)d->events.count);
    memcpy(modes, d->p + d->n_p - d->n_modes, sizeof *modes * (size_t)d->n_modes);
}
#endif
