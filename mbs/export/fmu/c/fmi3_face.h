/* What the parts of the FMI 3.0 face share: an instance, its status and its refusals. */
#ifndef MBS_FMI3_FACE_H
#define MBS_FMI3_FACE_H

#include "core.h"
#include "fmi3Functions.h"

typedef struct {
    core model;
    fmi3LogMessageCallback logger;
    fmi3InstanceEnvironment environment;
    fmi3IntermediateUpdateCallback update;
    char name[];
} face;

/* Bytes of an instance whose name has so many letters. */
#define INSTANCE_SIZE(letters) (sizeof(face) + (letters) + 1)

#define MODEL(c) (&((face *)(c))->model)
#define NEED(c) \
    if (!(c)) return fmi3Error

static inline fmi3Status as_fmi(core_status status) {
    static const fmi3Status table[] = {fmi3OK, fmi3Discard, fmi3Error};
    return table[status];
}

static inline fmi3Status refused(fmi3Instance c, const char *message) {
    NEED(c);
    return as_fmi(core_refuse(MODEL(c), "%s: %s", MODEL(c)->name, message));
}

/* An array that belongs to something the model has not must be empty. */
static inline fmi3Status none(fmi3Instance c, size_t n, const char *message) {
    NEED(c);
    return n ? refused(c, message) : fmi3OK;
}

/* What a call is about, element by element: a variable may be an array. */
typedef struct {
    const core_reference *ref;
    const core_integer *order; /* of derivatives, or NULL */
    size_t n;
    void *own;
} elements;

/* 1; or 0 after a message, where the values are not one for each element of the variables. */
int elements_begin(fmi3Instance c, elements *e, const fmi3ValueReference vr[], size_t n,
                   const fmi3Int32 order[], size_t n_values);
void elements_end(fmi3Instance c, elements *e);

#endif
