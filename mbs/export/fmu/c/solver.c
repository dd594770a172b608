/* The equations as the solver of co-simulation sees them: loops closed at every evaluation. */
#include "solver.h"

#include "closure.h"
#include "internal.h"

static int rhs(void *user, double t, const double *x, double *xdot) {
    core *c = user;
    return closure_solve(c, x, c->z) || core_call_rhs(c, t, x, c->z, xdot, NULL);
}

#ifdef MODEL_RODAS
static int jacobian(void *user, double t, const double *x, double *J, double *f_t) {
    core *c = user;
    double du[NU + 1];
    if (closure_solve(c, x, c->z)) return 1;
    core_point(c, &t, x, c->z);
    core_input_rates(c, t, du);
    c->arg[5] = du;
    c->res[0] = J;
    c->res[1] = f_t;
    return mbs_jacobian(c->arg, c->res, c->iw, c->w, 0);
}
#endif

void core_init_solver(core *c) {
#if defined MODEL_RODAS
    rodas_init(&c->solver, NX, rhs, jacobian, c, c->m.solver, c->work);
#elif defined MODEL_FIXED_STEP
    rk4_init(&c->solver, NX, rhs, c, c->m.solver, c->work);
#else
    dopri5_init(&c->solver, NX, rhs, c, c->m.solver, c->work);
#endif
    c->solver.nominal = MODEL_NOMINAL + STATES;
#ifdef MODEL_FIXED_STEP
    stepper_fix(&c->solver, MODEL_FIXED_STEP);
#endif
}

void core_prepare_solver(core *c) {
    c->solver.rtol = c->solver.atol = c->m.tolerance;
}
