/* Declarations for the files of the FMI 3.0 interface: instance, status and error messages. */
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

/* Size of an instance in bytes. letters: length of its name. */
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
    return as_fmi(log_error(&MODEL(c)->log, "%s", message));
}

/* Return an error with this message unless the array of size n, of a kind that the model does not
 * have, is empty. */
static inline fmi3Status none(fmi3Instance c, size_t n, const char *message) {
    NEED(c);
    return n ? refused(c, message) : fmi3OK;
}

/* Variables of a call, element by element, because a variable may be an array. */
typedef struct {
    const core_reference *ref;
    const core_integer *order; /* order of the derivative of each element, or NULL */
    size_t n;
    void *own; /* allocated memory, or NULL */
} elements;

/* Expand n variables into their elements. Returns 1, or 0 after an error message if n_values is not
 * the number of elements. */
int elements_begin(fmi3Instance c, elements *e, const fmi3ValueReference vr[], size_t n,
                   const fmi3Int32 order[], size_t n_values);
void elements_end(fmi3Instance c, elements *e);

#endif
