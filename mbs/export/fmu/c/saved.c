/* Saved states: copies of the memory of an instance. The serialized bytes contain format, model,
 * size and a checksum, to detect changes outside the FMU.
 */
#include "internal.h"

#include <math.h>
#include <string.h>

/* Format name; it changes when the contents of core_memory change. */
#define FORMAT "mbs state 3"

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
    if (!core_allowed(c, ~INTERMEDIATE, "saving the state")) return CORE_ERROR;
    if (!state) return core_refuse(c, "%s: the place of the state is NULL", c->name);
    if (!*state) *state = c->supply.take(c->supply.owner, sizeof **state);
    if (!*state) return core_refuse(c, "%s: no memory is left to save the state", c->name);
    memset(*state, 0, sizeof **state);
    memcpy((*state)->format, FORMAT, sizeof FORMAT);
    memcpy((*state)->guid, MODEL_GUID, sizeof MODEL_GUID);
    (*state)->size = sizeof **state;
    memcpy(&(*state)->m, &c->m, sizeof c->m);
    return CORE_OK;
}

/* Whether this instance can continue the saved mode: a co-simulation saved in event mode needs a
 * host that handles events. */
static int handled_here(const core *c, const core_memory *m) {
    return m->mode != EVENT || !m->cosimulation || c->event_mode;
}

static int ours(core *c, const core_state *s) {
    if (s && s->size == sizeof *s && !memcmp(s->format, FORMAT, sizeof FORMAT) &&
        !memcmp(s->guid, MODEL_GUID, sizeof MODEL_GUID) && s->m.cosimulation == c->m.cosimulation && handled_here(c, &s->m))
        return 1;
    core_refuse(c, "%s: the state was not saved by this model, of this version and in such an "
                "instance; give one of its own", c->name);
    return 0;
}

core_status core_restore(core *c, const core_state *state) {
    if (!core_allowed(c, ~INTERMEDIATE, "restoring a state") || !ours(c, state)) return CORE_ERROR;
    memcpy(&c->m, &state->m, sizeof c->m);
#ifdef MODEL_TREE
    if (c->passage) passage_forget(c->passage);
#endif
    return CORE_OK;
}

void core_free_state(core *c, core_state *state) {
    if (state) c->supply.drop(c->supply.owner, state);
}

size_t core_state_size(void) { return sizeof(core_state); }

core_status core_serialize(core *c, const core_state *state, char *bytes, size_t size) {
    unsigned sum;
    if (!ours(c, state)) return CORE_ERROR;
    if (!bytes || size < sizeof *state)
        return core_refuse(c, "%s: a state needs %u bytes", c->name, (unsigned)sizeof *state);
    memcpy(bytes, state, sizeof *state);
    sum = checksum(bytes);
    memcpy(bytes + offsetof(core_state, checksum), &sum, sizeof sum);
    return CORE_OK;
}

static int all_finite(const double *v, int n) {
    int i;
    for (i = 0; i < n; i++)
        if (!isfinite(v[i])) return 0;
    return 1;
}

static int is_flag(int value) { return value == 0 || value == 1; }

/* Whether an instance of this kind can be in the saved mode. */
static int possible_mode(const core_memory *m) {
    switch (m->mode) {
        case INSTANTIATED: case INITIALIZATION: case EVENT: case TERMINATED: return 1;
        case CONTINUOUS: return !m->cosimulation;
        case STEP: return m->cosimulation;
        default: return 0;
    }
}

static int parameters_in_bounds(const double *v) {
    int i;
    for (i = PARAMETERS; i < MODES; i++)
        if (v[i] < MODEL_MIN[i] || v[i] > MODEL_MAX[i]) return 0;
    return 1;
}

static int sane_inputs(const core_memory *m) {
    return (m->inputs == INPUTS_HELD || m->inputs == INPUTS_MOVE || m->inputs == INPUTS_MOVED) &&
           isfinite(m->input_time) && all_finite(m->slopes, INPUT_ORDERS * NU);
}

static int sane_watch(const watched *w) {
    int i;
    for (i = 0; i < NB; i++)
        if (w->on && w->sign[i] != 1.0 && w->sign[i] != -1.0) return 0;
    return is_flag(w->on) && isfinite(w->time) && all_finite(w->v, N_PASSIVE) &&
           all_finite(w->a, N_PASSIVE);
}

static int sane_events(const core_memory *m) {
#if NK > 0
    int i;
    for (i = 0; i < EVENTS_MEMORY(NK) - NK; i++) /* all except the rates, which may be NaN */
        if (isnan(m->events[i])) return 0;
    for (i = 0; i < NK; i++)
        if (!isfinite(m->offset[i]) || m->offset[i] < 0.0) return 0;
#endif
    (void)m;
    return 1;
}

#if MODEL_TREE_OUTSIDE
static int sane_charts(const core_charts *m) {
    return is_flag(m->tangent) && is_flag(m->loose) && is_flag(m->settled) &&
           isfinite(m->time) && isfinite(m->alignment) && all_finite(m->X, NT) &&
           all_finite(m->slope, NT);
}
#endif

/* Whether core_save could have written these values. Bytes from outside may contain anything. */
static int sane(const core_memory *m) {
    const double *v = m->values;
    int i;
    if (!possible_mode(m) || !is_flag(m->stale) || !is_flag(m->closed)) return 0;
    if (!isfinite(m->time) || !isfinite(m->tolerance) || !(m->tolerance > 0.0)) return 0;
    if (isnan(m->stop)) return 0;
    if (!all_finite(v + STATES, NX) || !all_finite(v + INPUTS, NU)) return 0;
    if (!all_finite(v + PARAMETERS, NP + NM)) return 0;
    if (!parameters_in_bounds(v)) return 0;
    if (!m->stale && !all_finite(v, INDICATORS)) return 0;
    if (!all_finite(m->guess, NZ) || !all_finite(m->cut, NCUT)) return 0;
    if (!all_finite(m->configuration_z, NZ)) return 0;
    if (!all_finite(m->configuration_x, NX) || !sane_inputs(m) || !sane_events(m)) return 0;
    if (!sane_watch(&m->watched)) return 0;
#ifdef MODEL_TREE
    if (!is_flag(m->loose) || !all_finite(m->tree, NT)) return 0;
    if (!passage_memory_finite(&m->passage) || !all_finite(m->origin, NT)) return 0;
    if (!is_flag(m->singular) || !all_finite(m->speeds, N_PASSIVE)) return 0;
    if (!all_finite(m->slope, NT)) return 0;
#endif
#if MODEL_TREE_OUTSIDE
    if (!all_finite(v + SLOTS, NX)) return 0;
    if (!sane_charts(&m->charts)) return 0;
#endif
    for (i = 0; i < STEPPER_MEMORY(0); i++)
        if (isnan(m->solver[i])) return 0;
    return 1;
}

core_status core_deserialize(core *c, const char *bytes, size_t size, core_state **state) {
    core_status status = CORE_OK;
    core_state *s;
    if (!bytes || !state)
        return core_refuse(c, "%s: the bytes or the place of the state are NULL", c->name);
    if (size != sizeof *s)
        return core_refuse(c, "%s: %lu bytes are no state of this model, which has %lu; give all "
                           "that were written", c->name, (unsigned long)size,
                           (unsigned long)sizeof *s);
    if (!(s = c->supply.take(c->supply.owner, sizeof *s)))
        return core_refuse(c, "%s: no memory is left for the state", c->name);
    memcpy(s, bytes, sizeof *s);
    if (s->checksum != checksum(bytes))
        status = core_refuse(c, "%s: the bytes of the state do not fit their checksum: they were "
                             "changed after they were written; write the state again", c->name);
    else if (!ours(c, s))
        status = CORE_ERROR;
    else if (!sane(&s->m))
        status = core_refuse(c, "%s: the bytes hold a state in which no instance of this model can "
                             "be; write one of its own", c->name);
    s->checksum = 0;
    if (status)
        core_free_state(c, s);
    else
        *state = s;
    return status;
}
