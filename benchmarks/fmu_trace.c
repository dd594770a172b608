/* Prints what an FMU 2.0 for co-simulation calculates, on Linux and on Windows.
 *
 *     fmu_trace LIBRARY TOKEN VALUES STEPS STEP
 *
 * After every step one line: the values of the references 0 .. VALUES - 1.
 */
#include <stdio.h>
#include <stdlib.h>

#ifdef _WIN32
#include <windows.h>
static void *opened(const char *path) { return (void *)LoadLibraryA(path); }
static void *found(void *library, const char *name) {
    return (void *)GetProcAddress((HMODULE)library, name);
}
#else
#include <dlfcn.h>
static void *opened(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }
static void *found(void *library, const char *name) { return dlsym(library, name); }
#endif

#include "fmi2Functions.h"

static void *library;

static void *function(const char *name) {
    void *f = found(library, name);
    if (!f) {
        fprintf(stderr, "%s is missing\n", name);
        exit(3);
    }
    return f;
}

#define CALL(name) ((name##TYPE *)function(#name))

static void done(fmi2Status status, const char *what) {
    if (status > fmi2Warning) {
        fprintf(stderr, "%s: status %d\n", what, (int)status);
        exit(4);
    }
}

static void heard(fmi2ComponentEnvironment e, fmi2String n, fmi2Status s, fmi2String c,
                  fmi2String m, ...) {
    (void)e, (void)n, (void)s, (void)c;
    fprintf(stderr, "%s\n", m);
}

int main(int count, char **given) {
    fmi2CallbackFunctions callbacks = {heard, calloc, free, NULL, NULL};
    fmi2ValueReference *references;
    fmi2Component c;
    fmi2Real *values, h;
    long k, i, n;
    if (count != 6) return 1;
    library = opened(given[1]);
    if (!library) return 2;
    n = atol(given[3]);
    h = atof(given[5]);
    references = calloc((size_t)n, sizeof *references);
    values = calloc((size_t)n, sizeof *values);
    for (i = 0; i < n; i++) references[i] = (fmi2ValueReference)i;
    c = CALL(fmi2Instantiate)("i", fmi2CoSimulation, given[2], "file:///", &callbacks, 0, 0);
    if (!c) return 5;
    done(CALL(fmi2SetupExperiment)(c, 1, 1e-8, 0.0, 0, 0.0), "setup");
    done(CALL(fmi2EnterInitializationMode)(c), "initialization");
    done(CALL(fmi2ExitInitializationMode)(c), "initialization");
    for (k = 0; k < atol(given[4]); k++) {
        done(CALL(fmi2DoStep)(c, (double)k * h, h, 1), "step");
        done(CALL(fmi2GetReal)(c, references, (size_t)n, values), "values");
        for (i = 0; i < n; i++) printf("%.17g%c", values[i], i + 1 < n ? ' ' : '\n');
    }
    done(CALL(fmi2Terminate)(c), "end");
    CALL(fmi2FreeInstance)(c);
    return 0;
}
