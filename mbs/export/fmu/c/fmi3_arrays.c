/* FMI 3.0 arrays: expand the variables of a call into the consecutive elements of the core. */
#include "fmi3_face.h"

#ifdef MODEL_ARRAYS

static size_t size_of(fmi3ValueReference vr) { return vr < N_VALUES ? (size_t)MODEL_SIZES[vr] : 1; }

/* Allocate the references and orders of all elements. Returns 0 on failure: a reference is that of
 * an array element, or no memory is left. */
static int spread(fmi3Instance c, elements *e, const fmi3ValueReference vr[], size_t n,
                  const fmi3Int32 order[]) {
    size_t i, k = 0, j, count = 0;
    core_reference *ref;
    core_integer *of_order;
    for (i = 0; i < n; count += size_of(vr[i++]))
        if (!size_of(vr[i])) {
            refused(c,
                    "a value reference is that of an element of an array; use that of the array");
            return 0;
        }
    e->own = MODEL(c)->host.supply.take(c, (count + 1) * (sizeof *ref + sizeof *of_order));
    if (!e->own) {
        refused(c, "no memory is left for the elements of the variables");
        return 0;
    }
    ref = e->own;
    of_order = (core_integer *)(ref + count);
    for (i = 0; i < n; i++)
        for (j = 0; j < size_of(vr[i]); j++, k++) {
            ref[k] = vr[i] + (core_reference)j;
            if (order) of_order[k] = order[i];
        }
    e->ref = ref;
    e->order = order ? of_order : NULL;
    e->n = count;
    return 1;
}

#endif

int elements_begin(fmi3Instance c, elements *e, const fmi3ValueReference vr[], size_t n,
                   const fmi3Int32 order[], size_t n_values) {
    e->ref = vr;
    e->order = order;
    e->n = n;
    e->own = NULL;
#ifdef MODEL_ARRAYS
    if (vr && !spread(c, e, vr, n, order)) return 0;
#endif
    if (e->n == n_values && (vr || !n)) return 1;
    elements_end(c, e);
    refused(c, "an array is NULL or too short; give one value for each element of the variables");
    return 0;
}

void elements_end(fmi3Instance c, elements *e) {
    if (e->own) MODEL(c)->host.supply.drop(c, e->own);
    e->own = NULL;
}
