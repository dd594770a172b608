/* FMI 2.0 interface to core.h, for model exchange and co-simulation. */
#include "fmi2_face.h"

#include <math.h>
#include <string.h>

#ifndef MODEL_BARE
#include "memory.h"
#endif

#define MODEL(c) (&((face *)(c))->model)
#define NEED(c) \
    if (!(c)) return fmi2Error

static fmi2Status as_fmi(core_status status) {
    static const fmi2Status table[] = {fmi2OK, fmi2Discard, fmi2Error};
    return table[status];
}

static void forward_log(void *host, const char *name, core_status status, const char *message) {
    face *f = host;
    if (f->logger)
        f->logger(f->environment, name, as_fmi(status), log_category(status), "%s", message);
}

static fmi2Status refused(fmi2Component c, const char *message) {
    NEED(c);
    return as_fmi(log_error(&MODEL(c)->log, "%s", message));
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

static fmi2Component no_instance(const fmi2CallbackFunctions *functions, const char *name,
                                 const char *message) {
    if (functions && functions->logger)
        functions->logger(functions->componentEnvironment, name, fmi2Error, "logStatusError", "%s",
                          message);
    return NULL;
}

#ifdef MODEL_BARE /* all memory comes from callbacks */

static face *new_face(const fmi2CallbackFunctions *functions, size_t size) {
    face *f = functions->allocateMemory(1, size);
    if (!f) return NULL;
    memset(f, 0, size);
    f->allocate = functions->allocateMemory;
    f->release = functions->freeMemory;
    return f;
}

static void *take(void *owner, size_t size) { return ((face *)owner)->allocate(1, size); }
static void drop(void *owner, void *memory) { ((face *)owner)->release(memory); }

#else

static face *new_face(const fmi2CallbackFunctions *functions, size_t size) {
    face *f = mbs_allocate(functions ? functions->componentEnvironment : NULL, size);
    if (f) memset(f, 0, size);
    return f;
}

static void *take(void *owner, size_t size) {
    return mbs_allocate(((face *)owner)->environment, size);
}

static void drop(void *owner, void *memory) { mbs_release(((face *)owner)->environment, memory); }

#endif

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean logging) {
    core_supply supply = {take, drop, NULL};
    face *f;
    (void)resources, (void)visible;
    if (!name || !*name) return no_instance(functions, "?", "the instance has no name");
    if (!guid || strcmp(guid, MODEL_GUID))
        return no_instance(functions, name,
                           "the GUID is not the one of this model: the model "
                           "description and the library belong to different FMUs");
    if (type != fmi2ModelExchange && type != fmi2CoSimulation)
        return no_instance(functions, name, "the type of the instance is unknown");
#ifdef MODEL_BARE
    if (type != fmi2CoSimulation)
        return no_instance(functions, name, "the model is for co-simulation alone");
    if (!functions || !functions->allocateMemory || !functions->freeMemory)
        return no_instance(functions, name,
                           "the model has memory by callbacks alone; give it "
                           "allocateMemory and freeMemory");
#endif
    f = new_face(functions, INSTANCE_SIZE(strlen(name)));
    if (!f) return no_instance(functions, name, "no memory is left");
    strcpy(f->name, name);
    if (functions) {
        f->logger = functions->logger;
        f->environment = functions->componentEnvironment;
    }
    supply.owner = f;
    if (core_init(&f->model, f->name, type == fmi2CoSimulation, forward_log, f, supply)) {
        fmi2FreeInstance(f);
        return no_instance(functions, name, "no memory is left");
    }
    f->model.log.discards = logging != fmi2False;
    return f;
}

void fmi2FreeInstance(fmi2Component c) {
    if (!c) return;
    core_end(MODEL(c));
    drop(c, c);
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n,
                               const fmi2String categories[]) {
    NEED(c);
    return as_fmi(log_select(&MODEL(c)->log, on, categories, n));
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop) {
    NEED(c);
    return as_fmi(core_setup(MODEL(c), tolerance_defined ? tolerance : MODEL_TOLERANCE, start,
                             stop_defined ? stop : HUGE_VAL));
}

#define FORWARD(name, call)            \
    fmi2Status name(fmi2Component c) { \
        NEED(c);                       \
        return as_fmi(call(MODEL(c))); \
    }

FORWARD(fmi2EnterInitializationMode, core_enter_initialization)
FORWARD(fmi2ExitInitializationMode, core_exit_initialization)
FORWARD(fmi2Terminate, core_terminate)
FORWARD(fmi2Reset, core_reset)
FORWARD(fmi2EnterEventMode, core_enter_event_mode)
FORWARD(fmi2EnterContinuousTimeMode, core_enter_continuous_mode)

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    NEED(c);
    return as_fmi(core_get(MODEL(c), vr, n, value));
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                       const fmi2Real value[]) {
    NEED(c);
    return as_fmi(core_set(MODEL(c), vr, n, value));
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                          fmi2Integer value[]) {
    NEED(c);
    return as_fmi(core_get_modes(MODEL(c), vr, n, value));
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                          const fmi2Integer value[]) {
    NEED(c);
    (void)vr, (void)value;
    return n ? refused(c, "integer variables are modes, which events set") : fmi2OK;
}

/* Error unless n is 0: no value reference of this type exists. */
static fmi2Status none(fmi2Component c, size_t n, const char *message) {
    NEED(c);
    return n ? refused(c, message) : fmi2OK;
}

#define NO_VARIABLES(type, text)                                                       \
    fmi2Status fmi2Get##type(fmi2Component c, const fmi2ValueReference vr[], size_t n, \
                             fmi2##type value[]) {                                     \
        (void)vr, (void)value;                                                         \
        return none(c, n, "the model has no " text " variables");                      \
    }                                                                                  \
    fmi2Status fmi2Set##type(fmi2Component c, const fmi2ValueReference vr[], size_t n, \
                             const fmi2##type value[]) {                               \
        (void)vr, (void)value;                                                         \
        return none(c, n, "the model has no " text " variables");                      \
    }

NO_VARIABLES(Boolean, "boolean")
NO_VARIABLES(String, "string")

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    NEED(c);
    return as_fmi(core_save(MODEL(c), (core_state **)state));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    NEED(c);
    return as_fmi(core_restore(MODEL(c), state));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    NEED(c);
    if (state) {
        core_free_state(MODEL(c), *state);
        *state = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    NEED(c);
    if (!state || !size) return refused(c, "the state or its size is NULL");
    *size = core_state_size();
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[],
                                 size_t size) {
    NEED(c);
    return as_fmi(core_serialize(MODEL(c), state, bytes, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                   fmi2FMUstate *state) {
    NEED(c);
    return as_fmi(core_deserialize(MODEL(c), bytes, size, (core_state **)state));
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[],
                                        size_t n_unknown, const fmi2ValueReference known[],
                                        size_t n_known, const fmi2Real seed[], fmi2Real answer[]) {
    NEED(c);
    if ((n_unknown && (!unknown || !answer)) || (n_known && (!known || !seed)))
        return refused(c, "an array of the derivative is NULL");
    return as_fmi(core_directional(MODEL(c), unknown, n_unknown, known, n_known, seed, answer));
}

/* ---- model exchange ---- */

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    int changed;
    core_status status;
    NEED(c);
    if (!info) return refused(c, "the event information is NULL");
    memset(info, 0, sizeof *info);
    status = core_update_discrete_states(MODEL(c), &changed);
    info->valuesOfContinuousStatesChanged = changed ? fmi2True : fmi2False;
    return as_fmi(status);
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_set_before,
                                       fmi2Boolean *enter_event_mode, fmi2Boolean *terminate) {
    core_status status;
    int event;
    NEED(c);
    (void)no_set_before;
    if (!enter_event_mode || !terminate) return refused(c, "a flag of the completed step is NULL");
    *enter_event_mode = *terminate = fmi2False;
    status = core_completed_step(MODEL(c), &event);
    *enter_event_mode = event != 0;
    return as_fmi(status);
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    NEED(c);
    return as_fmi(core_set_time(MODEL(c), time));
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
    NEED(c);
    return as_fmi(core_set_states(MODEL(c), x, n));
}

#define VECTOR(name, call)                                     \
    fmi2Status name(fmi2Component c, fmi2Real v[], size_t n) { \
        NEED(c);                                               \
        return as_fmi(call(MODEL(c), v, n));                   \
    }

VECTOR(fmi2GetContinuousStates, core_get_states)
VECTOR(fmi2GetDerivatives, core_get_derivatives)
VECTOR(fmi2GetNominalsOfContinuousStates, core_get_nominals)
VECTOR(fmi2GetEventIndicators, core_get_indicators)

/* ---- co-simulation ---- */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    NEED(c);
    return as_fmi(core_set_input_slopes(MODEL(c), vr, n, order, value));
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real value[]) {
    NEED(c);
    return as_fmi(core_get_output_slopes(MODEL(c), vr, n, order, value));
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real h, fmi2Boolean no_set_before) {
    core_stop stop;
    NEED(c);
    (void)no_set_before;
    return as_fmi(core_do_step(MODEL(c), time, h, &stop));
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    NEED(c);
    return refused(c, "no step is under way: steps are not asynchronous");
}

static fmi2Status no_status(fmi2Component c) {
    return refused(c, "this status is only known of asynchronous steps");
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    NEED(c);
    if (kind != fmi2LastSuccessfulTime || !value) return no_status(c);
    *value = MODEL(c)->m.run.time;
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    NEED(c);
    if (kind != fmi2Terminated || !value) return no_status(c);
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    (void)kind, (void)value;
    return no_status(c);
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)kind, (void)value;
    return no_status(c);
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    (void)kind, (void)value;
    return no_status(c);
}
