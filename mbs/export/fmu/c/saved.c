/* Saved states: copies of the memory of an instance. The serialized bytes contain format, model,
 * size and a checksum, to detect changes outside the FMU.
 */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "core.h"
#include "finite.h"

/* Format name; it changes when the contents of core_memory change. */
#define FORMAT "mbs state 4"

struct core_state {
    unsigned checksum; /* checksum of the members below; 0 unless the state is serialized */
    char format[sizeof FORMAT], guid[sizeof MODEL_GUID];
    size_t size;
    core_memory m;
};

/* CRC-32 of IEEE 802.3, as in zlib. Every change of a single byte changes it. */
static unsigned checksum(const char *bytes) {
    unsigned table[16], sum = 0xffffffffu, i, bit;
    size_t k;
    for (i = 0; i < 16; i++)
        for (table[i] = i, bit = 0; bit < 4; bit++)
            table[i] = table[i] >> 1 ^ (table[i] & 1 ? 0xedb88320u : 0);
    for (k = offsetof(core_state, format); k < sizeof(core_state); k++) {
        sum ^= (unsigned char)bytes[k];
        sum = sum >> 4 ^ table[sum & 15];
        sum = sum >> 4 ^ table[sum & 15];
    }
    return sum ^ 0xffffffffu;
}

core_status core_save(core *c, core_state **state) {
    if (!log_allowed(&c->log, ~INTERMEDIATE, "saving the state")) return CORE_ERROR;
    if (!state) return log_error(&c->log, "the place of the state is NULL");
    if (!*state) *state = c->host.supply.take(c->host.supply.owner, sizeof **state);
    if (!*state) return log_error(&c->log, "no memory is left to save the state");
    memset(*state, 0, sizeof **state);
    memcpy((*state)->format, FORMAT, sizeof FORMAT);
    memcpy((*state)->guid, MODEL_GUID, sizeof MODEL_GUID);
    (*state)->size = sizeof **state;
    memcpy(&(*state)->m, &c->m, sizeof c->m);
    return CORE_OK;
}

/* Whether this instance can continue the saved mode: a co-simulation saved in event mode needs a
 * importer that handles events. */
static int handled_here(const core *c, const core_memory *m) {
    return m->run.mode != EVENT || !m->run.cosimulation || c->host.event_mode;
}

/* Return 1 if this instance can be in the state, else 0 after an error message. */
static int ours(core *c, const core_state *s) {
    if (s && s->size == sizeof *s && !memcmp(s->format, FORMAT, sizeof FORMAT) &&
        !memcmp(s->guid, MODEL_GUID, sizeof MODEL_GUID) &&
        s->m.run.cosimulation == c->m.run.cosimulation && handled_here(c, &s->m))
        return 1;
    log_error(&c->log,
              "the state was not saved by this model, of this version and in such an "
              "instance; give one of its own");
    return 0;
}

core_status core_restore(core *c, const core_state *state) {
    if (!log_allowed(&c->log, ~INTERMEDIATE, "restoring a state") || !ours(c, state))
        return CORE_ERROR;
    memcpy(&c->m, &state->m, sizeof c->m);
#ifdef MODEL_TREE
    if (c->solver.passage) passage_forget(c->solver.passage);
#endif
    return CORE_OK;
}

void core_free_state(core *c, core_state *state) {
    if (state) c->host.supply.drop(c->host.supply.owner, state);
}

size_t core_state_size(void) { return sizeof(core_state); }

core_status core_serialize(core *c, const core_state *state, char *bytes, size_t size) {
    unsigned sum;
    if (!ours(c, state)) return CORE_ERROR;
    if (!bytes || size < sizeof *state)
        return log_error(&c->log, "a state needs %u bytes", (unsigned)sizeof *state);
    memcpy(bytes, state, sizeof *state);
    sum = checksum(bytes);
    memcpy(bytes + offsetof(core_state, checksum), &sum, sizeof sum);
    return CORE_OK;
}

static int is_flag(int value) { return value == 0 || value == 1; }

/* Whether an instance of this kind can be in the saved mode. */
static int possible_run(const core_run *r) {
    if (!isfinite(r->time) || isnan(r->stop)) return 0;
    switch (r->mode) {
        case INSTANTIATED:
        case INITIALIZATION:
        case EVENT:
        case TERMINATED: return 1;
        case CONTINUOUS: return !r->cosimulation;
        case STEP: return r->cosimulation;
        default: return 0;
    }
}

/* Whether the parameters in v (N_VALUES,) are within their bounds. */
static int parameters_in_bounds(const double *v) {
    int i;
    for (i = PARAMETERS; i < MODES; i++)
        if (v[i] < MODEL_MIN[i] || v[i] > MODEL_MAX[i]) return 0;
    return 1;
}

/* Whether the functions of an instance could have written the data of a part: its flags and finite
 * numbers. One function for each part of core_memory. */
static int possible_variables(const core_variables *m) {
    const double *v = m->values;
    if (!is_flag(m->stale)) return 0;
    if (!all_finite(v + STATES, NX) || !all_finite(v + INPUTS, NU)) return 0;
    if (!all_finite(v + PARAMETERS, NP + NM) || !parameters_in_bounds(v)) return 0;
    if (!m->stale && !all_finite(v, INDICATORS)) return 0;
#ifdef MODEL_TREE
    if (!all_finite(m->speeds, N_PASSIVE)) return 0;
#endif
#if MODEL_TREE_OUTSIDE
    if (!all_finite(v + CHART_STATES, NX)) return 0;
#endif
    return all_finite(m->guess, NZ) && all_finite(m->cut, NCUT);
}

static int possible_inputs(const core_inputs *m) {
    int moving = m->motion == INPUTS_MOVE || m->motion == INPUTS_MOVED;
    return (moving || m->motion == INPUTS_HELD) && isfinite(m->time) &&
           all_finite(m->slopes, INPUT_ORDERS * NU);
}

static int possible_configuration(const core_configuration *m) {
    const watched *w = &m->watched;
    int i;
    for (i = 0; i < NB; i++)
        if (w->on && w->sign[i] != 1.0 && w->sign[i] != -1.0) return 0;
    return is_flag(m->known) && all_finite(m->x, NX) && all_finite(m->z, NZ) && is_flag(w->on) &&
           isfinite(w->time) && all_finite(w->v, N_PASSIVE) && all_finite(w->a, N_PASSIVE);
}

#ifdef MODEL_TREE
static int possible_tree(const core_tree *m) {
    return is_flag(m->loose) && is_flag(m->singular) && all_finite(m->X, NT) &&
           all_finite(m->slope, NT) && passage_memory_finite(&m->passage) &&
           all_finite(m->origin, NT);
}
#endif

#if MODEL_TREE_OUTSIDE
static int possible_charts(const core_charts *m) {
    return is_flag(m->tangent) && is_flag(m->loose) && is_flag(m->settled) && isfinite(m->time) &&
           isfinite(m->alignment) && all_finite(m->X, NT) && all_finite(m->slope, NT);
}
#endif

static int possible_solver(const core_solver_memory *m) {
    int i;
    if (!isfinite(m->tolerance) || !(m->tolerance > 0.0)) return 0;
#ifdef MODEL_TREE
    if (!possible_tree(&m->tree)) return 0;
#endif
#if MODEL_TREE_OUTSIDE
    if (!possible_charts(&m->charts)) return 0;
#endif
    for (i = 0; i < STEPPER_MEMORY(0); i++)
        if (isnan(m->stepper[i])) return 0;
    return 1;
}

#if NK > 0
static int possible_events(const core_event_memory *m) {
    int i;
    for (i = 0; i < EVENTS_MEMORY(NK) - NK; i++) /* all except the rates, which may be NaN */
        if (isnan(m->detection[i])) return 0;
    for (i = 0; i < NK; i++)
        if (!isfinite(m->offset[i]) || m->offset[i] < 0.0) return 0;
    return 1;
}
#endif

/* Whether core_save could have written these values. Bytes from outside may contain anything. */
static int possible(const core_memory *m) {
#if NK > 0
    if (!possible_events(&m->events)) return 0;
#endif
    return possible_run(&m->run) && possible_variables(&m->variables) &&
           possible_inputs(&m->inputs) && possible_configuration(&m->configuration) &&
           possible_solver(&m->solver);
}

core_status core_deserialize(core *c, const char *bytes, size_t size, core_state **state) {
    core_status status = CORE_OK;
    core_state *s;
    if (!bytes || !state) return log_error(&c->log, "the bytes or the place of the state are NULL");
    if (size != sizeof *s)
        return log_error(&c->log,
                         "%lu bytes are no state of this model, which has %lu; give all "
                         "that were written",
                         (unsigned long)size, (unsigned long)sizeof *s);
    if (!(s = c->host.supply.take(c->host.supply.owner, sizeof *s)))
        return log_error(&c->log, "no memory is left for the state");
    memcpy(s, bytes, sizeof *s);
    if (s->checksum != checksum(bytes))
        status = log_error(&c->log,
                           "the bytes of the state do not fit their checksum: they were "
                           "changed after they were written; write the state again");
    else if (!ours(c, s))
        status = CORE_ERROR;
    else if (!possible(&s->m))
        status = log_error(&c->log,
                           "the bytes hold a state in which no instance of this model can "
                           "be; write one of its own");
    s->checksum = 0;
    if (status)
        core_free_state(c, s);
    else
        *state = s;
    return status;
}
