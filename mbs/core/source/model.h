/* A model as the run-time library evaluates it: one pointer for each function.
 *
 * The functions are machine code that was compiled for the model (`compiled_evaluate`), or anything
 * else that gives the values, such as functions that Python interprets (module.c).
 */
#ifndef MBS_MODEL_H
#define MBS_MODEL_H

/* Return values of an evaluation. */
enum {
    MODEL_STOP = -1, /* the integration must stop now, for example after control-C */
    MODEL_VALUES = 0,
    MODEL_NO_VALUE = 1 /* the function has no value here: a shorter step may succeed */
};

/* Evaluate a function. arg: a pointer to each input. res: a pointer to each output, NULL for an
 * output that is not required. */
typedef int (*model_evaluate)(void *self, const double **arg, double **res);

typedef struct {
    model_evaluate evaluate; /* NULL if the model has no such function */
    void *self;
} model_function;

/* Machine code with the calling convention of CasADi, and its scratch memory. */
typedef struct {
    int (*code)(const double **arg, double **res, long long *iw, double *w, int mem);
    int inputs, outputs;
    const double **arg; /* CasADi may require more elements than inputs */
    double **res;
    long long *iw;
    double *w;
} compiled_function;

/* Evaluate a compiled_function (self), in the form of model_evaluate. */
int compiled_evaluate(void *self, const double **arg, double **res);

#endif
