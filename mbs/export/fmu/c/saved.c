/* Saved states: copies of the memory of an instance. */
#include "internal.h"

#include <stdlib.h>
#include <string.h>

struct core_state {
    char guid[sizeof MODEL_GUID];
    size_t size;
    core_memory m;
};

core_status core_save(core *c, core_state **state) {
    if (!state) return core_refuse(c, "%s: the place of the state is NULL", c->name);
    if (!*state) *state = calloc(1, sizeof **state);
    if (!*state) return core_refuse(c, "%s: no memory is left to save the state", c->name);
    memcpy((*state)->guid, MODEL_GUID, sizeof MODEL_GUID);
    (*state)->size = sizeof **state;
    memcpy(&(*state)->m, &c->m, sizeof c->m);
    return CORE_OK;
}

static int ours(core *c, const core_state *s) {
    if (s && s->size == sizeof *s && !memcmp(s->guid, MODEL_GUID, sizeof MODEL_GUID) &&
        s->m.cosimulation == c->m.cosimulation)
        return 1;
    core_refuse(c, "%s: the state was not saved by this model", c->name);
    return 0;
}

core_status core_restore(core *c, const core_state *state) {
    if (!ours(c, state)) return CORE_ERROR;
    memcpy(&c->m, &state->m, sizeof c->m);
    return CORE_OK;
}

void core_free_state(core_state *state) { free(state); }

size_t core_state_size(void) { return sizeof(core_state); }

core_status core_serialize(core *c, const core_state *state, char *bytes, size_t size) {
    if (!ours(c, state)) return CORE_ERROR;
    if (!bytes || size < sizeof *state)
        return core_refuse(c, "%s: a state needs %u bytes", c->name, (unsigned)sizeof *state);
    memcpy(bytes, state, sizeof *state);
    return CORE_OK;
}

core_status core_deserialize(core *c, const char *bytes, size_t size, core_state **state) {
    core_state *s = NULL;
    if (bytes && state && size == sizeof *s && (s = malloc(sizeof *s)) != NULL) {
        memcpy(s, bytes, sizeof *s);
        if (ours(c, s)) {
            *state = s;
            return CORE_OK;
        }
        free(s);
        return CORE_ERROR;
    }
    return core_refuse(c, "%s: the bytes are not a state of this model", c->name);
}
