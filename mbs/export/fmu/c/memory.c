/* Memory from the heap of C. Where there is none, leave this file out and give these two functions,
 * such as from arrays of your own. */
#include "memory.h"

#include <stdlib.h>

void *mbs_allocate(void *environment, size_t size) {
    (void)environment;
    return malloc(size);
}

void mbs_release(void *environment, void *memory) {
    (void)environment;
    free(memory);
}
