/* How many communication steps a second an FMU for co-simulation makes in a plain C program.
 *
 *     fmu_host LIBRARY VERSION TOKEN STEPS STEP TOLERANCE ROUNDS
 *
 * Prints the best of the rounds, steps a second; each round is a run from the start.
 */
#define _POSIX_C_SOURCE 199309L
#include <dlfcn.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2Functions.h"
#include "fmi3Functions.h"

static void *library;

static void *function(const char *name) {
    void *f = dlsym(library, name);
    if (!f) {
        fprintf(stderr, "%s is missing\n", name);
        exit(3);
    }
    return f;
}

#define CALL(name) ((name##TYPE *)function(#name))
#define DONE(status)                                                    \
    do {                                                                \
        if ((int)(status) > 1) {                                        \
            fprintf(stderr, "line %d: status %d\n", __LINE__, (int)(status)); \
            exit(4);                                                    \
        }                                                               \
    } while (0)

static void log_2(fmi2ComponentEnvironment e, fmi2String n, fmi2Status s, fmi2String c,
                 fmi2String m, ...) {
    (void)e, (void)n, (void)s, (void)c;
    fprintf(stderr, "%s\n", m);
}

static void log_3(fmi3InstanceEnvironment e, fmi3Status s, fmi3String c, fmi3String m) {
    (void)e, (void)s, (void)c;
    fprintf(stderr, "%s\n", m);
}

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double run2(const char *token, long steps, double h, double tolerance) {
    fmi2CallbackFunctions callbacks = {log_2, calloc, free, NULL, NULL};
    fmi2DoStepTYPE *step = CALL(fmi2DoStep);
    double begin;
    long k;
    fmi2Component c =
        CALL(fmi2Instantiate)("i", fmi2CoSimulation, token, "file:///", &callbacks, 0, 0);
    if (!c) exit(5);
    DONE(CALL(fmi2SetupExperiment)(c, 1, tolerance, 0.0, 0, 0.0));
    DONE(CALL(fmi2EnterInitializationMode)(c));
    DONE(CALL(fmi2ExitInitializationMode)(c));
    begin = now();
    for (k = 0; k < steps; k++) DONE(step(c, (double)k * h, h, 1));
    begin = now() - begin;
    DONE(CALL(fmi2Terminate)(c));
    CALL(fmi2FreeInstance)(c);
    return begin;
}

static double run3(const char *token, long steps, double h, double tolerance) {
    fmi3DoStepTYPE *step = CALL(fmi3DoStep);
    fmi3Boolean event, stop, early;
    double begin, reached;
    long k;
    fmi3Instance c = CALL(fmi3InstantiateCoSimulation)("i", token, "/", false, false, false, false,
                                                       NULL, 0, NULL, log_3, NULL);
    if (!c) exit(5);
    DONE(CALL(fmi3EnterInitializationMode)(c, true, tolerance, 0.0, false, 0.0));
    DONE(CALL(fmi3ExitInitializationMode)(c));
    begin = now();
    for (k = 0; k < steps; k++)
        DONE(step(c, (double)k * h, h, true, &event, &stop, &early, &reached));
    begin = now() - begin;
    DONE(CALL(fmi3Terminate)(c));
    CALL(fmi3FreeInstance)(c);
    return begin;
}

int main(int count, char **given) {
    double best = 1e300, h, tolerance;
    long steps, round;
    if (count != 8) return 1;
    library = dlopen(given[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        return 2;
    }
    steps = atol(given[4]);
    h = atof(given[5]);
    tolerance = atof(given[6]);
    for (round = 0; round < atol(given[7]); round++) {
        double seconds = strcmp(given[2], "2.0") ? run3(given[3], steps, h, tolerance)
                                                 : run2(given[3], steps, h, tolerance);
        if (seconds < best) best = seconds;
    }
    printf("%.0f\n", (double)steps / best);
    return 0;
}
