/* Data of the steps through singular configurations, which the files passage_*.c share.
 *
 * Notation: q, v, a are positions, velocities and accelerations of the tree. J v = b and J a = c
 * are the constraint rows. xi = C (q - q0) and u = C N v are the coordinates of the chart with
 * origin q0 and their rates. d is the number of coordinates. y = (xi, u, z) is a state in the
 * chart.
 */
#ifndef MBS_PASSAGE_DATA_H
#define MBS_PASSAGE_DATA_H

#include "passage.h"
#include "sparse_pattern.h"
#include "sparse_qr.h"

/* Constraint rows, forces and tangents at a state. */
typedef struct {
    passage_rows rows;
    double *inertia;      /* elements of M by its pattern */
    double *L, *f, *rate; /* Cholesky factor of M; forces; rates of the other states */
    int *L_end;           /* row after the last element of each column of L */
    sparse_qr qr;         /* factors of L^-1 J' */
    double *T;            /* (nv, d) tangents, orthonormal in the metric of M */
    int rank;
    double sigma;   /* smallest pivot of R: distance from the loss of rank */
    double penalty; /* factor of J' J that was added to M, usually 0 */
} passage_frame;

/* Sparsity patterns of the model. */
typedef struct {
    sparse_pattern slope, J, N, M;
    int *J_from; /* indices in slope of the elements of J, if nq equals nv */
} passage_structure;

/* Local tangent coordinates. Their origin is the frame `origin`. */
typedef struct {
    int dimension;    /* d */
    double *C;        /* (d, nq) matrix from positions to chart coordinates */
    double *drift;    /* (nv,) velocity of the origin at u = 0, if rows depend on time */
    double alignment; /* alignment of the tangents at the last state with the tangents at the
                         origin: 1 if parallel, 0 if orthogonal */
    int valid;        /* whether an external integrator can use the chart */
} passage_coordinate_chart;

/* State from which the branch is followed, instead of a prediction from the origin. */
typedef struct {
    const double *state; /* NULL: no guide */
    double *rate;        /* (nq,) rates of its positions */
    double ahead;        /* time by which the positions are extrapolated [s] */
} passage_guide;

/* State at which the next step begins, with its chart coordinates. */
typedef struct {
    int valid;
    double time;
    double *x, *y; /* (n,), (2 d + nz,) */
} passage_prepared;

/* Stages of the Runge-Kutta step in the chart. */
typedef struct {
    double *y;          /* (2 d + nz,) chart coordinates of a stage */
    double *slope_y[7]; /* slopes of the chart coordinates */
    double *slope_x[7]; /* slopes of the states x */
} passage_stages;

/* Dense outputs (5, n) in the form of dopri5.h. */
typedef struct {
    double *accepted, *attempted; /* of the last accepted step, of the attempted step */
} passage_dense;

/* Events of the present and the last step. */
typedef struct {
    int charted;    /* whether the attempted step is made in the chart */
    int kept;       /* whether the last accepted step was made in the chart */
    int opened;     /* whether `open` of the wrapped method was called at the present state */
    int singular;   /* whether the last state is a mean of neighbours */
    int missed;     /* whether branches that do not meet were found since the last full step */
    int rejections; /* number of steps rejected in succession for the rounding of a stage */
    double sigma;   /* smallest sigma at the stages, as a fraction of the largest sigma */
} passage_step;

/* Arrays for temporary values. */
typedef struct {
    sparse_qr qr;
    double *state;      /* (n,) */
    double *direction;  /* (d,) */
    double *neighbours; /* state, slope, slope in the chart and coordinates of a neighbour */
    double *matrix;     /* (positions + nv, nq), then (nq, nq + 1) */
    double *square;     /* (nv, nv) */
    double *residual;   /* (positions + 2 nv,) */
    double *y, *w;      /* (2 nv + nz,) */
} passage_scratch;

/* Memory blocks that contain all arrays. */
typedef struct {
    double *numbers;
    int *indices;
} passage_storage;

struct passage {
    stepper *stepper;
    const stepper_method *regular; /* method away from singular configurations */
    passage_size size;
    passage_model model;
    passage_memory *memory;
    double *origin_state; /* (n,) state at the origin of the chart */
    passage_structure patterns;
    passage_frame origin, point; /* frames at the origin of the chart and at the present state */
    passage_coordinate_chart chart;
    passage_guide guide;
    passage_prepared prepared;
    passage_stages stages;
    passage_dense dense;
    passage_step step;
    passage_scratch scratch;
    passage_storage storage;
};

/* Allocate all arrays after size was set, and make the patterns. Returns 1 if no memory is left. */
int passage_allocate(passage *g, const passage_patterns *given);

/* Free all memory except the structure. */
void passage_release(passage *g);

#endif
