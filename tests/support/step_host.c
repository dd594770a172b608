/* A host that makes communication steps and nothing else, of FMI 2.0 or, with FMI3, of 3.0.
 *
 *     step_host LIBRARY TOKEN TOLERANCE STEPS STEP START VALUE OUTPUT ...
 *
 * START is the reference of a variable that begins with VALUE. Prints the values of the variables
 * OUTPUT ... after every step, one line for each.
 */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef FMI3
#include "fmi3Functions.h"
typedef fmi3ValueReference reference;
#else
#include "fmi2Functions.h"
typedef fmi2ValueReference reference;
#endif

enum { MOST = 64 };

static void *library;

static void must(int done, const char *what) {
    if (done) return;
    fprintf(stderr, "%s\n", what);
    exit(1);
}

/* ISO C knows no conversion from an object to a function, so the address itself is copied. */
static void find(const char *name, void *function) {
    void *found = dlsym(library, name);
    must(found != NULL, name);
    memcpy(function, &found, sizeof found);
}

#define FUNCTION(name)   \
    name##TYPE *f##name; \
    find(#name, &f##name)

#define OK(name, ...) must((int)f##name(__VA_ARGS__) == 0, #name)

#ifdef FMI3

static void say(fmi3InstanceEnvironment e, fmi3Status s, fmi3String c, fmi3String message) {
    (void)e, (void)s, (void)c;
    fprintf(stderr, "%s\n", message);
}

static void *begin(const char *token, double tolerance, reference start, double value) {
    FUNCTION(fmi3InstantiateCoSimulation);
    FUNCTION(fmi3SetFloat64);
    FUNCTION(fmi3EnterInitializationMode);
    FUNCTION(fmi3ExitInitializationMode);
    void *c = ffmi3InstantiateCoSimulation("host", token, "", fmi3False, fmi3True, fmi3False,
                                           fmi3False, NULL, 0, NULL, say, NULL);
    must(c != NULL, "no instance");
    OK(fmi3SetFloat64, c, &start, 1, &value, 1);
    OK(fmi3EnterInitializationMode, c, fmi3True, tolerance, 0.0, fmi3False, 0.0);
    OK(fmi3ExitInitializationMode, c);
    return c;
}

static void step(void *c, double time, double length) {
    fmi3Boolean event, ended, early;
    fmi3Float64 last;
    FUNCTION(fmi3DoStep);
    OK(fmi3DoStep, c, time, length, fmi3True, &event, &ended, &early, &last);
}

static void get(void *c, const reference *outputs, size_t count, double *values) {
    FUNCTION(fmi3GetFloat64);
    OK(fmi3GetFloat64, c, outputs, count, values, count);
}

static void end(void *c) {
    FUNCTION(fmi3Terminate);
    FUNCTION(fmi3FreeInstance);
    OK(fmi3Terminate, c);
    ffmi3FreeInstance(c);
}

#else

static void say(fmi2ComponentEnvironment e, fmi2String name, fmi2Status s, fmi2String c,
                fmi2String message, ...) {
    (void)e, (void)name, (void)s, (void)c;
    fprintf(stderr, "%s\n", message);
}

static void *begin(const char *token, double tolerance, reference start, double value) {
    static const fmi2CallbackFunctions functions = {say, calloc, free, NULL, NULL};
    FUNCTION(fmi2Instantiate);
    FUNCTION(fmi2SetReal);
    FUNCTION(fmi2SetupExperiment);
    FUNCTION(fmi2EnterInitializationMode);
    FUNCTION(fmi2ExitInitializationMode);
    void *c = ffmi2Instantiate("host", fmi2CoSimulation, token, "", &functions, fmi2False, fmi2True);
    must(c != NULL, "no instance");
    OK(fmi2SetReal, c, &start, 1, &value);
    OK(fmi2SetupExperiment, c, fmi2True, tolerance, 0.0, fmi2False, 0.0);
    OK(fmi2EnterInitializationMode, c);
    OK(fmi2ExitInitializationMode, c);
    return c;
}

static void step(void *c, double time, double length) {
    FUNCTION(fmi2DoStep);
    OK(fmi2DoStep, c, time, length, fmi2True);
}

static void get(void *c, const reference *outputs, size_t count, double *values) {
    FUNCTION(fmi2GetReal);
    OK(fmi2GetReal, c, outputs, count, values);
}

static void end(void *c) {
    FUNCTION(fmi2Terminate);
    FUNCTION(fmi2FreeInstance);
    OK(fmi2Terminate, c);
    ffmi2FreeInstance(c);
}

#endif

int main(int given, char **word) {
    reference outputs[MOST];
    double values[MOST], length;
    size_t count, i;
    long k, steps;
    void *c;
    must(given > 8 && given - 8 <= MOST, "words are missing");
    library = dlopen(word[1], RTLD_NOW | RTLD_LOCAL);
    must(library != NULL, "no library");
    count = (size_t)(given - 8);
    for (i = 0; i < count; i++) outputs[i] = (reference)strtoul(word[8 + i], NULL, 10);
    steps = atol(word[4]);
    length = atof(word[5]);
    c = begin(word[2], atof(word[3]), (reference)strtoul(word[6], NULL, 10), atof(word[7]));
    for (k = 0; k < steps; k++) {
        step(c, (double)k * length, length);
        get(c, outputs, count, values);
        for (i = 0; i < count; i++) printf(i + 1 < count ? "%.17g " : "%.17g\n", values[i]);
    }
    end(c);
    dlclose(library);
    return 0;
}
