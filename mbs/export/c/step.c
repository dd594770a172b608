/* Motion of a mechanism by the classical Runge-Kutta method of order 4, with loops closed at every
 * evaluation. No memory is allocated. All data of a run are in the state, which the caller owns.
 *
 * Results equal those of co-simulation of an FMU with solver="rk4" and steps of the same length.
 *
 * Source: Kutta 1901; Hairer, Norsett and Wanner 1993, II.1.
 */

/* Offsets in the scratch memory w. The generated functions use its beginning. */
enum {
    SLOPES = WORK,
    RATE = SLOPES + WATCH_WORK,
    POINT = RATE + NX,
    NEXT_X = POINT + NX,
    NEXT_Z = NEXT_X + NX,
    PASSIVE = NEXT_Z + NZ,
    CONFIGURATION = PASSIVE + 2 * N_PASSIVE,
    W_SIZE = CONFIGURATION + NX + NZ
};

/* Compile-time check that the scratch size in the header is large enough. */
typedef char scratch_is_large_enough[W_SIZE <= STEP_SZ_W ? 1 : -1];

/* Arguments of the generated functions in one call, and the loops. */
typedef struct {
    const real *arg[5];
    real *res[3];
    loops loop;
} equations;

static void copy(real *to, const real *from, int n) {
    int i;
    for (i = 0; i < n; i++) to[i] = from[i];
}

static void use(equations *e, real *x, real *z, const real *guess, const real *p, real *w) {
    loops l;
    l.x = x;
    l.z = z;
    l.guess = guess;
    l.p = p;
    l.arg = e->arg;
    l.res = e->res;
    l.iw = NULL;
    l.w = w;
    e->loop = l;
}

static void point(equations *e, const real *t, const real *x, const real *z, const real *u) {
    e->arg[0] = t;
    e->arg[1] = x;
    e->arg[2] = z;
    e->arg[3] = u;
    e->arg[4] = e->loop.p;
}

static int status_of(int closure) {
    if (closure == CLOSURE_OK) return MBS_OK;
    return closure == CLOSURE_OPEN ? MBS_OPEN : MBS_UNDETERMINED;
}

/* Compute z and the derivative xdot of x at time t. MBS_NO_RESULT if a derivative is not finite. */
static int rates(equations *e, real t, const real *x, real *z, const real *u, real *xdot) {
    int status = status_of(closure_solve(&e->loop, x, z));
    if (status) return status;
    point(e, &t, x, z, u);
    e->res[0] = xdot;
    (void)mbs_rates(e->arg, e->res, NULL, e->loop.w, 0);
    return all_finite(xdot, NX) ? MBS_OK : MBS_NO_RESULT;
}

#if NB > 0
/* Compute the data of the check for singular configurations (watch.h) at an accepted state. */
static int look(equations *e, real t, const real *x, const real *u, watched *now, real *w) {
    real *z = w + CONFIGURATION + NX;
    int status = status_of(closure_solve(&e->loop, x, z));
    if (status) return status;
    now->on = 1;
    now->time = t;
    if (watch_signs(&e->loop, x, z, now->sign, w + SLOPES)) return MBS_UNDETERMINED;
    point(e, &t, x, z, u);
    e->res[0] = now->v;
    e->res[1] = now->a;
    (void)mbs_passive(e->arg, e->res, NULL, e->loop.w, 0);
    return all_finite(now->v, N_PASSIVE) && all_finite(now->a, N_PASSIVE) ? MBS_OK : MBS_NO_RESULT;
}
#endif

static int unit_quaternions(const real *x) {
    int k, i;
    for (k = 0; k < N_QUATERNIONS; k++) {
        real sum = REAL(0.0);
        for (i = 0; i < 4; i++) sum += x[MODEL_QUATERNIONS[k] + i] * x[MODEL_QUATERNIONS[k] + i];
        if (!(real_abs(real_sqrt(sum) - REAL(1.0)) <= UNIT_LENGTH)) return 0;
    }
    return 1;
}

static int within_bounds(const real *p) {
    int k;
    for (k = 0; k < NP; k++)
        if (!(p[k] >= MODEL_MIN[k] && p[k] <= MODEL_MAX[k])) return 0;
    return 1;
}

/* Check and store the start values, and close the loops. Steps continue from s->x and s->z. */
static int begin(SYSTEM(state) * s, const real *x, const real *guess, real *w) {
    equations e = {0};
    real *z = w + NEXT_Z;
    int status;
    use(&e, s->x, s->z, guess, s->p, w);
    if (!all_finite(x, NX) || !all_finite(guess, NZ) || !all_finite(s->p, NP))
        return MBS_NOT_FINITE;
    if (!unit_quaternions(x)) return MBS_QUATERNION;
    if (!within_bounds(s->p)) return MBS_PARAMETER;
    status = status_of(closure_start(&e.loop, x, z));
    if (!status && closure_singular(&e.loop, x, z)) status = MBS_UNDETERMINED;
    copy(s->x, x, NX);
    copy(s->z, z, NZ);
    return status;
}

int SYSTEM(start)(SYSTEM(state) * s, const real *x, const real *guess, const real *p, real *w) {
    int status, i;
    s->t = REAL(0.0);
    s->known = 0;
    copy(s->p, p ? p : MODEL_START + PARAMETERS, NP);
    copy(w + POINT, x ? x : MODEL_START + STATES, NX);
    status = begin(s, w + POINT, guess ? guess : MODEL_START + DEPENDENTS, w);
    for (i = 0; i < NX && status; i++) s->x[i] = NOT_A_NUMBER;
    for (i = 0; i < NZ && status; i++) s->z[i] = NOT_A_NUMBER;
    return status;
}

static int same(const real *a, const real *b, int n) {
    int i;
    for (i = 0; i < n; i++)
        if (a[i] < b[i] || a[i] > b[i]) return 0;
    return 1;
}

/* Compute the slope at the start of a step. The last step stored it, unless inputs have changed. */
static int open_step(SYSTEM(state) * s, equations *e, const real *u, real *w) {
    int status;
    if (s->known && same(u, s->u, NU)) return MBS_OK;
    s->known = 0;
    copy(s->u, u, NU);
#if NB > 0
    status = look(e, s->t, s->x, u, &s->watched, w);
    if (status) return status;
#endif
    status = rates(e, s->t, s->x, w + NEXT_Z, u, s->slope);
    s->known = status == MBS_OK;
    return status;
}

/* Compute the state at the end and its slope, in NEXT_X, NEXT_Z and RATE of w. */
static int advance(const SYSTEM(state) * s, equations *e, real end, real h, real *w) {
    static const real PLACE[] = {REAL(0.0), REAL(0.5), REAL(0.5), REAL(1.0)};
    static const real WEIGHT[] = {REAL(1.0), REAL(2.0), REAL(2.0), REAL(1.0)};
    real *slope = w + RATE, *at = w + POINT, *y = w + NEXT_X, *z = w + NEXT_Z;
    int i, k, status;
    copy(slope, s->slope, NX);
    copy(y, s->x, NX);
    for (k = 0; k < 4; k++) {
        for (i = 0; i < NX; i++) at[i] = s->x[i] + PLACE[k] * h * slope[i];
        if (k) {
            status = rates(e, s->t + PLACE[k] * h, at, z, s->u, slope);
            if (status) return status;
        }
        for (i = 0; i < NX; i++) y[i] += h / REAL(6.0) * WEIGHT[k] * slope[i];
    }
    if (!all_finite(y, NX)) return MBS_NO_RESULT;
    status = rates(e, end, y, z, s->u, slope);
    if (status) return status;
    return closure_singular(&e->loop, y, z) ? MBS_UNDETERMINED : MBS_OK;
}

int SYSTEM(step)(SYSTEM(state) * s, const real *u, real h, real *w) {
    equations e = {0};
#if NB > 0
    watched now;
#endif
    real end = s->t + h;
    int status;
    if (!all_finite(u, NU) || !(h > REAL(0.0)) || !real_finite(end)) return MBS_NOT_FINITE;
    if (!all_finite(s->x, NX)) return MBS_NO_RESULT; /* the state was not started */
    use(&e, s->x, s->z, MODEL_START + DEPENDENTS, s->p, w);
    status = open_step(s, &e, u, w);
    if (status) return status;
    status = advance(s, &e, end, STEP_LENGTH(s->t, h, end), w);
    if (status) return status;
#if NB > 0
    use(&e, w + NEXT_X, w + NEXT_Z, MODEL_START + DEPENDENTS, s->p, w);
    status = look(&e, end, w + NEXT_X, u, &now, w);
    if (status) return status;
    if (watch_differ(&s->watched, &now, MODEL_UNITS)) return MBS_UNDETERMINED;
    s->watched = now;
#endif
    s->t = end;
    copy(s->x, w + NEXT_X, NX);
    copy(s->z, w + NEXT_Z, NZ);
    copy(s->slope, w + RATE, NX);
    return MBS_OK;
}

static int motion(const SYSTEM(state) * s, const real *u, real *q, real *v, real *a, real *w) {
    equations e = {0};
    real *x = w + CONFIGURATION, *z = w + CONFIGURATION + NX;
    int status;
    if (!all_finite(u, NU)) return MBS_NOT_FINITE;
    if (!all_finite(s->x, NX)) return MBS_NO_RESULT;
    copy(x, s->x, NX);
    copy(z, s->z, NZ);
    use(&e, x, z, MODEL_START + DEPENDENTS, s->p, w);
    status = status_of(closure_solve(&e.loop, x, w + NEXT_Z));
    if (status) return status;
    point(&e, &s->t, x, w + NEXT_Z, u);
    e.res[0] = q;
    e.res[1] = v;
    e.res[2] = a;
    (void)mbs_motion(e.arg, e.res, NULL, w, 0);
    return all_finite(q, NQ) && all_finite(v, NV) && all_finite(a, NV) ? MBS_OK : MBS_NO_RESULT;
}

int SYSTEM(motion)(const SYSTEM(state) * s, const real *u, real *q, real *v, real *a, real *w) {
    int i, status = motion(s, u, q, v, a, w);
    for (i = 0; i < NQ && status; i++) q[i] = NOT_A_NUMBER;
    for (i = 0; i < NV && status; i++) v[i] = a[i] = NOT_A_NUMBER;
    return status;
}
