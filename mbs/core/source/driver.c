#include "driver.h"

#include <fenv.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dopri5.h"
#include "finite.h"
#include "passage_start.h"
#include "projection.h"
#include "rodas.h"

#ifdef __FAST_MATH__
#error "results of the run-time library need IEEE arithmetic: compile it without -ffast-math"
#endif

struct driver {
    stepper solver;
    events events;
    passage *passage;
    driver_model model;
    double *p, *memory, *work, *projected, *modes, *event_memory, *event_work, *chart_origin;
    passage_memory chart_memory;
    int stopped; /* whether an evaluation returned MODEL_STOP, which ends all evaluations */
};

static int evaluate(driver *d, const model_function *f, double t, const double *x,
                    const double *fired, double **res) {
    const double *arg[4];
    int answer;
    if (d->stopped) return MODEL_NO_VALUE;
    t = stepper_law_time(&d->solver, t);
    arg[0] = &t;
    arg[1] = x;
    arg[2] = d->p;
    arg[3] = fired;
    answer = f->evaluate(f->self, arg, res);
    d->stopped = answer == MODEL_STOP;
    return answer;
}

static int pair_of(driver *d, const model_function *f, double t, const double *x, double *first,
                   double *second) {
    double *res[2];
    res[0] = first;
    res[1] = second;
    return evaluate(d, f, t, x, NULL, res);
}

static int rhs(void *user, double t, const double *x, double *xdot) {
    driver *d = user;
    return pair_of(d, &d->model.rhs, t, x, xdot, NULL);
}

static int jacobian(void *user, double t, const double *x, double *J, double *f_t) {
    driver *d = user;
    return pair_of(d, &d->model.jacobian, t, x, J, f_t);
}

static int project_once(void *user, double t, const double *x, double *after, double *residual) {
    driver *d = user;
    return pair_of(d, &d->model.project, t, x, after, residual);
}

static int project(void *user, double t, double *x) {
    driver *d = user;
    if (d->passage && !passage_project(d->passage, t, x)) return 0;
    return projection_converge(d->model.n, project_once, d, t, x, d->projected);
}

static int indicators(void *user, double t, const double *x, double *values) {
    driver *d = user;
    return pair_of(d, &d->model.indicators, t, x, values, NULL);
}

static int rates(void *user, double t, const double *x, double *values) {
    driver *d = user;
    return pair_of(d, &d->model.rates, t, x, values, NULL);
}

static int approaches(void *user, double t, const double *x, double *values) {
    driver *d = user;
    return pair_of(d, &d->model.approaches, t, x, values, NULL);
}

static double *modes_of(const driver *d) { return d->p + d->model.n_p - d->model.n_modes; }

static int jump(void *user, double t, double *x, const double *fired) {
    driver *d = user;
    double *res[2];
    res[0] = d->projected;
    res[1] = d->modes;
    if (evaluate(d, &d->model.jump, t, x, fired, res)) return 1;
    if (!all_finite(d->modes, d->model.n_modes)) return 1;
    memcpy(x, d->projected, sizeof *x * (size_t)d->model.n);
    memcpy(modes_of(d), d->modes, sizeof *d->modes * (size_t)d->model.n_modes);
    return 0;
}

static int rows(void *user, double t, const double *x, const passage_rows *r) {
    driver *d = user;
    double *res[8];
    res[0] = r->position;
    res[1] = r->slope;
    res[2] = r->J;
    res[3] = r->b;
    res[4] = r->c;
    res[5] = r->N;
    res[6] = r->bend;
    res[7] = r->rank;
    return evaluate(d, &d->model.rows, t, x, NULL, res);
}

static int forces(void *user, double t, const double *x, double *M, double *f, double *rate) {
    driver *d = user;
    double *res[3];
    res[0] = M;
    res[1] = f;
    res[2] = rate;
    return evaluate(d, &d->model.forces, t, x, NULL, res);
}

static int regularity(void *user, double t, const double *x, double *value) {
    driver *d = user;
    return pair_of(d, &d->model.regularity, t, x, value, NULL);
}

static double *array(size_t count) { return calloc(count + 1, sizeof(double)); }

static int watch(driver *d) {
    static const events_model fast = {indicators, rates, jump, approaches};
    static const events_model slow = {indicators, rates, jump, NULL};
    int count = d->model.n_indicators;
    d->event_memory = array((size_t)EVENTS_MEMORY(count));
    d->event_work = array((size_t)EVENTS_WORK(d->model.n, count));
    if (!d->event_memory || !d->event_work) return 1;
    events_init(&d->events, &d->solver, count, d->model.approaches.evaluate ? &fast : &slow,
                d->event_memory, d->event_work);
    return 0;
}

static int pass(driver *d) {
    passage_model model = {rows, forces, regularity, 0.0};
    model.typical = d->model.typical;
    d->chart_origin = array((size_t)d->model.n);
    if (!d->chart_origin) return 1;
    d->passage = passage_new(&d->solver, &d->model.size, &d->model.patterns, &model,
                             &d->chart_memory, d->chart_origin);
    return d->passage == NULL;
}

void driver_free(driver *d) {
    if (!d) return;
    passage_free(d->passage);
    free(d->p);
    free(d->memory);
    free(d->work);
    free(d->projected);
    free(d->modes);
    free(d->event_memory);
    free(d->event_work);
    free(d->chart_origin);
    free(d);
}

static void begin(driver *d, const driver_control *control, double t) {
    int n = d->model.n;
    if (d->model.jacobian.evaluate)
        rodas_init(&d->solver, n, rhs, jacobian, d, d->memory, d->work);
    else
        dopri5_init(&d->solver, n, rhs, d, d->memory, d->work);
    if (d->model.project.evaluate) d->solver.project = project;
    d->solver.rtol = control->rtol;
    d->solver.atol = control->atol;
    d->solver.h_max = control->max_step;
    d->solver.afresh = control->first_step;
    stepper_start(&d->solver, t);
}

driver *driver_new(const driver_model *model, const double *p, const driver_control *control,
                   double t) {
    driver *d = calloc(1, sizeof *d);
    size_t n = (size_t)model->n;
    if (!d) return NULL;
    d->model = *model;
    d->p = array((size_t)model->n_p);
    d->memory = array(STEPPER_MEMORY(n));
    d->work = array(model->jacobian.evaluate ? RODAS_WORK(n) : DOPRI5_WORK(n));
    d->projected = array(n);
    d->modes = array((size_t)model->n_modes);
    if (!d->p || !d->memory || !d->work || !d->projected || !d->modes) {
        driver_free(d);
        return NULL;
    }
    memcpy(d->p, p, sizeof *p * (size_t)model->n_p);
    begin(d, control, t);
    if ((model->indicators.evaluate && watch(d)) || (model->rows.evaluate && pass(d))) {
        driver_free(d);
        return NULL;
    }
    if (control->absolute) {
        d->solver.nominal = control->absolute;
        d->solver.relative = control->relative;
    }
    if (control->n_stops)
        stepper_stop_at(&d->solver, control->stops, control->jumps, control->n_stops);
    return d;
}

void driver_replace(driver *d, const driver_model *model) { d->model = *model; }

int driver_begin(driver *d, double *x) {
    int status = STEPPER_OK;
    fenv_t environment; /* other libraries may have disabled denormal numbers */
    fegetenv(&environment);
    fesetenv(FE_DFL_ENV);
    if (d->solver.project && project(d, stepper_time(&d->solver), x))
        status = STEPPER_PROJECTION_FAILED;
    else if (d->model.indicators.evaluate)
        status = events_start(&d->events, x);
    fesetenv(&environment);
    return d->stopped ? DRIVER_STOPPED : status;
}

int driver_table(driver *d, double *x, const double *times, long count, double *table, long *done,
                 long budget) {
    int status;
    fenv_t environment;
    fegetenv(&environment);
    fesetenv(FE_DFL_ENV);
    if (d->model.indicators.evaluate)
        status = events_table(&d->events, x, times, count, table, done, budget);
    else
        status = stepper_table(&d->solver, x, times, count, table, done, budget);
    fesetenv(&environment);
    return d->stopped ? DRIVER_STOPPED : status;
}

int driver_leaves(driver *d, const double *x, double *slope) {
    double t = stepper_time(&d->solver);
    if (!d->passage) return 0;
    return passage_singular(d->passage, t, x) && !passage_slope(d->passage, t, x, slope, NULL);
}

double driver_time(const driver *d) { return stepper_time(&d->solver); }
double driver_step(const driver *d) { return stepper_wanted_step(&d->solver); }
const double *driver_fired(const driver *d) { return events_fired(&d->events); }
const double *driver_modes(const driver *d) { return modes_of(d); }
