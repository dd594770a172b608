#include "passage.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "passage_chart.h"
#include "passage_crossing.h"
#include "passage_data.h"
#include "passage_step.h"

passage *passage_new(stepper *s, const passage_size *size, const passage_patterns *patterns,
                     const passage_model *model, passage_memory *memory, double *origin) {
    passage *g = calloc(1, sizeof *g);
    if (!g) return NULL;
    g->stepper = s;
    g->size = *size;
    g->model = *model;
    g->memory = memory;
    g->origin_state = origin;
    if (passage_allocate(g, patterns)) {
        passage_free(g);
        return NULL;
    }
    g->regular = s->method;
    s->method = &PASSAGE_METHOD;
    s->passage = g;
    passage_start(g);
    return g;
}

void passage_free(passage *g) {
    if (!g) return;
    passage_release(g);
    free(g);
}

void passage_start(passage *g) {
    memset(g->memory, 0, sizeof *g->memory);
    memset(g->origin_state, 0, sizeof(double) * (size_t)g->stepper->n);
    g->memory->regularity_max = g->model.typical;
    passage_forget(g);
}

void passage_forget(passage *g) {
    g->prepared.valid = g->chart.valid = 0;
    g->step.kept = g->step.charted = g->step.missed = g->step.opened = 0;
}

int passage_memory_finite(const passage_memory *m) {
    return isfinite(m->sigma_max) && isfinite(m->regularity_max) && isfinite(m->regularity) &&
           isfinite(m->regularity_rate) && isfinite(m->regularity_known) &&
           isfinite(m->regularity_time) && isfinite(m->has_origin) && isfinite(m->origin_time);
}

int passage_project(passage *g, double t, double *x) {
    double *y = g->stages.y, h;
    if (!g->step.kept || !g->prepared.valid) return 1;
    if (chart_coordinates(g, t, x, y)) return 0;
    h = stepper_last_step(g->stepper);
    if (!crossing_state(g, t, y, g->scratch.state, g->stages.slope_x[1], g->stages.slope_y[1]) &&
        !step_leaves_branch(g, g->scratch.state, x, h, 0.0))
        memcpy(x, g->scratch.state, sizeof(double) * (size_t)g->stepper->n);
    return 0;
}
