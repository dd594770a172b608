/* An instance of FMI 2.0. */
#ifndef MBS_FMI2_FACE_H
#define MBS_FMI2_FACE_H

#include "core.h"
#include "fmi2Functions.h"

typedef struct {
    core model;
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
    fmi2CallbackAllocateMemory allocate; /* used if all memory comes from callbacks (MODEL_BARE) */
    fmi2CallbackFreeMemory release;
    char name[];
} face;

/* Size of an instance in bytes. letters: length of its name. */
#define INSTANCE_SIZE(letters) (sizeof(face) + (letters) + 1)

#endif
