/* A host of an FMU of FMI 2.0: event_host LIBRARY GUID CYCLES
 * Runs it CYCLES times, each time from a new instance, over events, with states saved, serialized
 * and taken back on the way; prints the last values, and pages in use after a tenth and all. */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum { STEPS = 30, SAVED = 13 };
static const fmi2Real STEP_LENGTH = 0.05;
static const fmi2ValueReference STATES[] = {0, 1};

static void *library;

#define CALL(name) ((name##TYPE *)dlsym(library, #name))
#define MUST(call)                                      \
    if ((call) != fmi2OK) {                             \
        fprintf(stderr, "line %d: refused\n", __LINE__); \
        exit(1);                                        \
    }

static void say(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category,
                fmi2String message, ...) {
    va_list args;
    (void)e, (void)name, (void)status, (void)category;
    va_start(args, message);
    vfprintf(stderr, message, args);
    va_end(args);
}

static void run(fmi2Component c, int first) {
    int k;
    for (k = first; k < STEPS; k++)
        MUST(CALL(fmi2DoStep)(c, k * STEP_LENGTH, STEP_LENGTH, fmi2False));
}

static fmi2Component start(const char *guid) {
    static const fmi2CallbackFunctions functions = {say, calloc, free, NULL, NULL};
    fmi2Component c =
        CALL(fmi2Instantiate)("host", fmi2CoSimulation, guid, "", &functions, fmi2False, fmi2True);
    if (!c) exit(2);
    MUST(CALL(fmi2SetupExperiment)(c, fmi2True, 1e-8, 0.0, fmi2False, 0.0));
    MUST(CALL(fmi2EnterInitializationMode)(c));
    MUST(CALL(fmi2ExitInitializationMode)(c));
    return c;
}

/* From a copy of the bytes of a state, which must lead where the first run has led. */
static void repeat(fmi2Component c, fmi2FMUstate *state, const fmi2Real *end) {
    fmi2FMUstate copy = NULL;
    fmi2Real again[2];
    fmi2Byte *bytes;
    size_t size;
    MUST(CALL(fmi2SerializedFMUstateSize)(c, *state, &size));
    bytes = malloc(size);
    MUST(CALL(fmi2SerializeFMUstate)(c, *state, bytes, size));
    MUST(CALL(fmi2DeSerializeFMUstate)(c, bytes, size, &copy));
    free(bytes);
    MUST(CALL(fmi2SetFMUstate)(c, copy));
    run(c, SAVED);
    MUST(CALL(fmi2GetReal)(c, STATES, 2, again));
    if (memcmp(again, end, sizeof again)) exit(3);
    MUST(CALL(fmi2FreeFMUstate)(c, state));
    MUST(CALL(fmi2FreeFMUstate)(c, &copy));
}

static void cycle(const char *guid, fmi2Real *end) {
    fmi2Component c = start(guid);
    fmi2FMUstate state = NULL;
    int k;
    for (k = 0; k < SAVED; k++)
        MUST(CALL(fmi2DoStep)(c, k * STEP_LENGTH, STEP_LENGTH, fmi2False));
    MUST(CALL(fmi2GetFMUstate)(c, &state));
    run(c, SAVED);
    MUST(CALL(fmi2GetReal)(c, STATES, 2, end));
    repeat(c, &state, end);
    MUST(CALL(fmi2Terminate)(c));
    MUST(CALL(fmi2Reset)(c));
    CALL(fmi2FreeInstance)(c);
}

/* Of the heap and the stack. */
static long pages(void) {
    long data = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (!file) return 0;
    if (fscanf(file, "%*d %*d %*d %*d %*d %ld", &data) != 1) data = 0;
    fclose(file);
    return data;
}

int main(int count, char **argument) {
    int k, cycles;
    long early = 0;
    fmi2Real end[2] = {0.0, 0.0};
    if (count != 4 || !(library = dlopen(argument[1], RTLD_NOW))) return 4;
    cycles = atoi(argument[3]);
    for (k = 0; k < cycles; k++) {
        cycle(argument[2], end);
        if (k == cycles / 10) early = pages();
    }
    printf("%.17g %.17g %ld %ld\n", end[0], end[1], early, pages());
    dlclose(library);
    return 0;
}
