/* Memory of instances and saved states: two functions, which users may replace. */
#ifndef MBS_MEMORY_H
#define MBS_MEMORY_H

#include <stddef.h>

/* Allocate memory aligned for doubles; NULL if no memory is left. environment: pointer that the
 * importer passed at instantiation. */
void *mbs_allocate(void *environment, size_t size);

void mbs_release(void *environment, void *memory);

#endif
