/* FMI 3.0 interface to core.h, part 1: instances and values, model exchange and co-simulation. */
#include <math.h>
#include <string.h>

#include "fmi3_face.h"
#include "memory.h"

static void forward_log(void *host, const char *name, core_status status, const char *message) {
    face *f = host;
    (void)name;
    if (f->logger) f->logger(f->environment, as_fmi(status), log_category(status), message);
}

const char *fmi3GetVersion(void) { return fmi3Version; }

static void *no_instance(fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                         const char *message) {
    if (logger) logger(environment, fmi3Error, log_category(CORE_ERROR), message);
    return NULL;
}

static void *take(void *owner, size_t size) {
    return mbs_allocate(((face *)owner)->environment, size);
}

static void drop(void *owner, void *memory) { mbs_release(((face *)owner)->environment, memory); }

static face *instantiate(fmi3String name, fmi3String token, int cosimulation, fmi3Boolean logging,
                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger) {
    core_supply supply = {take, drop, NULL};
    face *f;
    if (!name || !*name) return no_instance(environment, logger, "the instance has no name");
    if (!token || strcmp(token, MODEL_GUID))
        return no_instance(environment, logger,
                           "the instantiation token is not the one of this "
                           "model: the model description and the library belong to different FMUs");
#ifdef MODEL_BARE
    if (!cosimulation)
        return no_instance(environment, logger, "the model is for co-simulation alone");
#endif
    f = mbs_allocate(environment, INSTANCE_SIZE(strlen(name)));
    if (!f) return no_instance(environment, logger, "no memory is left");
    memset(f, 0, sizeof *f);
    strcpy(f->name, name);
    f->logger = logger;
    f->environment = environment;
    supply.owner = f;
    if (core_init(&f->model, f->name, cosimulation, forward_log, f, supply)) {
        fmi3FreeInstance(f);
        return no_instance(environment, logger, "no memory is left");
    }
    f->model.log.discards = logging;
    f->model.host.timed = 1;
    return f;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging,
                                          fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback logger) {
    (void)resources, (void)visible;
    return instantiate(name, token, 0, logging, environment, logger);
}

/* Call the intermediate update callback. Inputs cannot be set; all variables can be read. */
static int report(void *host, double time, int may_return, double *until) {
    face *f = host;
    fmi3Boolean asked = fmi3False;
    fmi3Float64 end = *until;
    f->update(f->environment, time, fmi3False, fmi3True, fmi3True, may_return != 0, &asked, &end);
    *until = end;
    return asked;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging,
                                         fmi3Boolean event_mode, fmi3Boolean early_return,
                                         const fmi3ValueReference intermediate[],
                                         size_t n_intermediate, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback logger,
                                         fmi3IntermediateUpdateCallback update) {
    face *f;
    size_t i;
    (void)resources, (void)visible;
    for (i = 0; i < n_intermediate; i++)
        if (!intermediate || intermediate[i] > TIME_REFERENCE)
            return no_instance(environment, logger, "an intermediate variable is unknown");
    f = instantiate(name, token, 1, logging, environment, logger);
    if (!f) return NULL;
    f->update = update;
    f->model.host.watch = update ? report : NULL;
    f->model.host.event_mode = event_mode;
    f->model.host.early_return = early_return;
    return f;
}

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
    fmi3ClockUpdateCallback clock_update, fmi3LockPreemptionCallback lock,
    fmi3UnlockPreemptionCallback unlock) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    (void)clock_update, (void)lock, (void)unlock;
    return no_instance(environment, logger,
                       "this model has no scheduled execution; use model "
                       "exchange or co-simulation");
}

void fmi3FreeInstance(fmi3Instance c) {
    if (!c) return;
    core_end(MODEL(c));
    drop(c, c);
}

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n,
                               const fmi3String categories[]) {
    NEED(c);
    return as_fmi(log_select(&MODEL(c)->log, on, categories, n));
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined,
                                       fmi3Float64 tolerance, fmi3Float64 start,
                                       fmi3Boolean stop_defined, fmi3Float64 stop) {
    core_status status;
    NEED(c);
    status = core_setup(MODEL(c), tolerance_defined ? tolerance : MODEL_TOLERANCE, start,
                        stop_defined ? stop : HUGE_VAL);
    return as_fmi(status ? status : core_enter_initialization(MODEL(c)));
}

#define FORWARD(name, call)            \
    fmi3Status name(fmi3Instance c) {  \
        NEED(c);                       \
        return as_fmi(call(MODEL(c))); \
    }

FORWARD(fmi3ExitInitializationMode, core_exit_initialization)
FORWARD(fmi3Terminate, core_terminate)
FORWARD(fmi3Reset, core_reset)
FORWARD(fmi3EnterEventMode, core_enter_event_mode)
FORWARD(fmi3EnterContinuousTimeMode, core_enter_continuous_mode)
FORWARD(fmi3EnterStepMode, core_enter_step_mode)

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                          fmi3Float64 value[], size_t n_values) {
    size_t first = 0, i;
    fmi3Status status = fmi3OK;
    elements e;
    NEED(c);
    if (n && !value) return refused(c, "the array of the values is NULL");
    if (!n && !n_values) return as_fmi(core_get(MODEL(c), NULL, 0, NULL));
    if (!elements_begin(c, &e, vr, n, NULL, n_values)) return fmi3Error;
    for (i = 0; i <= e.n && !status; i++) {
        if (i < e.n && e.ref[i] != TIME_REFERENCE) continue;
        status = as_fmi(core_get(MODEL(c), e.ref + first, i - first, value + first));
        if (i < e.n && !status) value[i] = MODEL(c)->m.run.time;
        first = i + 1;
    }
    elements_end(c, &e);
    return status;
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                          const fmi3Float64 value[], size_t n_values) {
    core_status status;
    elements e;
    NEED(c);
    if (!elements_begin(c, &e, vr, n, NULL, n_values)) return fmi3Error;
    status = core_set(MODEL(c), e.ref, e.n, value);
    elements_end(c, &e);
    return as_fmi(status);
}

fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Int32 value[],
                        size_t n_values) {
    NEED(c);
    if (n != n_values) return refused(c, "give one place for each integer variable");
    return as_fmi(core_get_modes(MODEL(c), vr, n, value));
}

fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                        const fmi3Int32 value[], size_t n_values) {
    (void)vr, (void)value, (void)n_values;
    return none(c, n, "32-bit integers are modes, which events set");
}

/* Getters and setters of types without variables. */
#define NO_VARIABLES(type, text)                                                      \
    fmi3Status fmi3Get##type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, \
                             fmi3##type value[], size_t n_values) {                   \
        (void)vr, (void)value, (void)n_values;                                        \
        return none(c, n, "the model has no " text " variables");                     \
    }                                                                                 \
    fmi3Status fmi3Set##type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, \
                             const fmi3##type value[], size_t n_values) {             \
        (void)vr, (void)value, (void)n_values;                                        \
        return none(c, n, "the model has no " text " variables");                     \
    }

NO_VARIABLES(Float32, "32-bit float")
NO_VARIABLES(Int8, "8-bit integer")
NO_VARIABLES(UInt8, "unsigned 8-bit integer")
NO_VARIABLES(Int16, "16-bit integer")
NO_VARIABLES(UInt16, "unsigned 16-bit integer")
NO_VARIABLES(UInt32, "unsigned 32-bit integer")
NO_VARIABLES(Int64, "64-bit integer")
NO_VARIABLES(UInt64, "unsigned 64-bit integer")
NO_VARIABLES(Boolean, "boolean")
NO_VARIABLES(String, "string")

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, size_t sizes[],
                         fmi3Binary value[], size_t n_values) {
    (void)vr, (void)sizes, (void)value, (void)n_values;
    return none(c, n, "the model has no binary variables");
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                         const size_t sizes[], const fmi3Binary value[], size_t n_values) {
    (void)vr, (void)sizes, (void)value, (void)n_values;
    return none(c, n, "the model has no binary variables");
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference vr, size_t *n) {
    (void)vr, (void)n;
    return refused(c,
                   "dependencies of elements are not listed; see those of the variables in the "
                   "model description");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference dependent,
                                       size_t elements[], fmi3ValueReference independents[],
                                       size_t independent_elements[], fmi3DependencyKind kinds[],
                                       size_t n) {
    (void)dependent, (void)elements, (void)independents, (void)independent_elements;
    (void)kinds, (void)n;
    return refused(c,
                   "dependencies of elements are not listed; see those of the variables in the "
                   "model description");
}
