/* An instance of FMI 2.0. */
#ifndef MBS_FMI2_FACE_H
#define MBS_FMI2_FACE_H

#include "core.h"
#include "fmi2Functions.h"

typedef struct {
    core model;
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
    fmi2CallbackAllocateMemory allocate; /* where memory comes from by callbacks alone */
    fmi2CallbackFreeMemory release;
    char name[];
} face;

/* Bytes of an instance whose name has so many letters. */
#define INSTANCE_SIZE(letters) (sizeof(face) + (letters) + 1)

#endif
