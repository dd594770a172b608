#include "configuration.h"

#include <string.h>

core_status configuration_failed(machine *m, int status) {
    if (status == CLOSURE_SINGULAR || status == CLOSURE_NEARLY)
        return log_failed(m->log,
                          "singular configuration at time %.9g (%s): the states do not determine "
                          "the dependent coordinates; start elsewhere or choose other states",
                          m->run->time, log_where(m->log));
    return log_failed(m->log,
                      "unclosable configuration at time %.9g (%s): no dependent coordinates near "
                      "the last ones close the loops; start elsewhere or move less",
                      m->run->time, log_where(m->log));
}

core_status configuration_accept(machine *m, const double *x, const double *z) {
    if (closure_singular(&m->loops, x, z)) return configuration_failed(m, CLOSURE_SINGULAR);
    memcpy(m->accepted->x, x, NX * sizeof *x);
    memcpy(m->accepted->z, z, NZ * sizeof *z);
    m->accepted->known = 1;
    return CORE_OK;
}

core_status configuration_accept_states(machine *m) {
    const double *x = m->values + STATES;
    int status = closure_solve(&m->loops, x, m->z);
    return status ? configuration_failed(m, status) : configuration_accept(m, x, m->z);
}
