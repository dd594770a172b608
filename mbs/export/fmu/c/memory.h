/* Where instances and saved states come from: two functions, which may be your own. */
#ifndef MBS_MEMORY_H
#define MBS_MEMORY_H

#include <stddef.h>

/* Memory that is aligned for doubles; NULL: none is left. environment: what the importer gave to
 * the instance. */
void *mbs_allocate(void *environment, size_t size);

void mbs_release(void *environment, void *memory);

#endif
