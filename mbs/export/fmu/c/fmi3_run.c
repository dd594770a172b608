/* FMI 3.0 interface, part 2: saved states, derivatives, model exchange, co-simulation. */
#include "fmi3_face.h"

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
    NEED(c);
    return as_fmi(core_save(MODEL(c), (core_state **)state));
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
    NEED(c);
    return as_fmi(core_restore(MODEL(c), state));
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
    NEED(c);
    if (state) {
        core_free_state(MODEL(c), *state);
        *state = NULL;
    }
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
    NEED(c);
    if (!state || !size) return refused(c, "the state or its size is NULL");
    *size = core_state_size();
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[],
                                 size_t size) {
    NEED(c);
    return as_fmi(core_serialize(MODEL(c), state, (char *)bytes, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size,
                                   fmi3FMUState *state) {
    NEED(c);
    return as_fmi(core_deserialize(MODEL(c), (const char *)bytes, size, (core_state **)state));
}

#define DERIVATIVE(name, call, seeds, answers)                                                  \
    fmi3Status name(fmi3Instance c, const fmi3ValueReference unknown[], size_t n_unknown,       \
                    const fmi3ValueReference known[], size_t n_known, const fmi3Float64 seed[], \
                    size_t n_seed, fmi3Float64 answer[], size_t n_answer) {                     \
        core_status status = CORE_ERROR;                                                        \
        elements of, by;                                                                        \
        NEED(c);                                                                                \
        if ((n_seed && !seed) || (n_answer && !answer))                                         \
            return refused(c, "an array of the derivative is NULL");                            \
        if (!elements_begin(c, &of, unknown, n_unknown, NULL, answers)) return fmi3Error;       \
        if (elements_begin(c, &by, known, n_known, NULL, seeds)) {                              \
            status = call(MODEL(c), of.ref, of.n, by.ref, by.n, seed, answer);                  \
            elements_end(c, &by);                                                               \
        }                                                                                       \
        elements_end(c, &of);                                                                   \
        return as_fmi(status);                                                                  \
    }

/* A directional derivative has a seed for each known and a result for each unknown. An adjoint
 * derivative has a seed for each unknown and a result for each known. */
DERIVATIVE(fmi3GetDirectionalDerivative, core_directional, n_seed, n_answer)
DERIVATIVE(fmi3GetAdjointDerivative, core_adjoint, n_answer, n_seed)

/* ---- model exchange ---- */

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals, fmi3Boolean *values,
                                    fmi3Boolean *next_defined, fmi3Float64 *next) {
    core_status status;
    int changed;
    NEED(c);
    if (!again || !terminate || !nominals || !values || !next_defined || !next)
        return refused(c, "a flag of the event is NULL");
    *again = *terminate = *nominals = *values = *next_defined = fmi3False;
    *next = 0.0;
    status = core_update_discrete_states(MODEL(c), &changed);
    *values = changed != 0;
    return as_fmi(status);
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) {
    return refused(c, "discrete states are evaluated when they are updated");
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean no_set_before,
                                       fmi3Boolean *enter_event_mode, fmi3Boolean *terminate) {
    core_status status;
    int event;
    NEED(c);
    (void)no_set_before;
    if (!enter_event_mode || !terminate) return refused(c, "a flag of the step is NULL");
    *enter_event_mode = *terminate = fmi3False;
    status = core_completed_step(MODEL(c), &event);
    *enter_event_mode = event != 0;
    return as_fmi(status);
}

fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time) {
    NEED(c);
    return as_fmi(core_set_time(MODEL(c), time));
}

fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t n) {
    NEED(c);
    return as_fmi(core_set_states(MODEL(c), x, n));
}

#define VECTOR(name, call)                                       \
    fmi3Status name(fmi3Instance c, fmi3Float64 v[], size_t n) { \
        NEED(c);                                                 \
        return as_fmi(call(MODEL(c), v, n));                     \
    }

VECTOR(fmi3GetContinuousStates, core_get_states)
VECTOR(fmi3GetContinuousStateDerivatives, core_get_derivatives)
VECTOR(fmi3GetNominalsOfContinuousStates, core_get_nominals)
VECTOR(fmi3GetEventIndicators, core_get_indicators)

static fmi3Status give_number(fmi3Instance c, size_t *n, size_t count) {
    NEED(c);
    if (!n) return refused(c, "the place of the number is NULL");
    *n = count;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n) {
    return give_number(c, n, NK + NC);
}
fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n) {
    return give_number(c, n, NX);
}

/* ---- co-simulation ---- */

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 h, fmi3Boolean no_set_before,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early,
                      fmi3Float64 *last) {
    core_status status;
    core_stop stop;
    NEED(c);
    (void)no_set_before;
    if (!event || !terminate || !early || !last) return refused(c, "a flag of the step is NULL");
    *event = *terminate = *early = fmi3False;
    status = core_do_step(MODEL(c), time, h, &stop);
    *event = stop.event != 0;
    *early = stop.early != 0;
    *last = MODEL(c)->m.run.time;
    return as_fmi(status);
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                    const fmi3Int32 orders[], fmi3Float64 values[],
                                    size_t n_values) {
    core_status status;
    elements e;
    NEED(c);
    if (!elements_begin(c, &e, vr, n, orders, n_values)) return fmi3Error;
    status = core_get_output_slopes(MODEL(c), e.ref, e.n, e.order, values);
    elements_end(c, &e);
    return as_fmi(status);
}
