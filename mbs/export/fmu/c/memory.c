/* Memory from the C heap. On a platform without a heap, leave this file out and write these two
 * functions, for example with static arrays. */
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
