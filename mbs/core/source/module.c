/* The Python extension `mbs.core._core`: integrations of compiled and of interpreted models.
 *
 * It uses the limited interface of Python 3.11. One library therefore serves all later versions.
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <math.h>
#include <string.h>

#include "array_call.h"
#include "driver.h"
#include "least_squares.h"

/* Evaluation: a function of a model. */

typedef struct {
    PyObject_HEAD
    model_function function;
    compiled_function compiled;
    void *memory;                     /* of the compiled function */
    PyObject *call, *examine, *owner; /* owner: keeps the memory of the function */
    Py_buffer *views; /* of the inputs, then of the outputs of an interpreted function */
    int inputs, outputs, opened;
} Evaluation;

/* An external function that fails writes nothing: old values must not remain. */
static void spoil(const Py_buffer *view) {
    double *value = view->buf, *end = value + view->len / (Py_ssize_t)sizeof *value;
    while (value < end) *value++ = NAN;
}

static int interpreted_evaluate(void *self, const double **arg, double **res) {
    Evaluation *e = self;
    PyGILState_STATE state = PyGILState_Ensure();
    PyObject *answer;
    int k, status = MODEL_VALUES;
    for (k = 0; k < e->inputs; k++) memcpy(e->views[k].buf, arg[k], (size_t)e->views[k].len);
    for (k = e->inputs; k < e->opened; k++) spoil(&e->views[k]);
    answer = PyObject_CallNoArgs(e->call);
    if (answer && PyErr_CheckSignals()) Py_CLEAR(answer);
    if (!answer) { /* `examine` returns if there is no value, and raises if the run must stop */
        PyObject *type, *error, *trace;
        PyErr_Fetch(&type, &error, &trace);
        PyErr_NormalizeException(&type, &error, &trace);
        answer = PyObject_CallFunctionObjArgs(e->examine, error, NULL);
        Py_XDECREF(type);
        Py_XDECREF(error);
        Py_XDECREF(trace);
        status = answer ? MODEL_NO_VALUE : MODEL_STOP;
    }
    Py_XDECREF(answer);
    for (k = 0; status == MODEL_VALUES && k < e->outputs; k++) {
        const Py_buffer *view = &e->views[e->inputs + k];
        if (res[k]) memcpy(res[k], view->buf, (size_t)view->len);
    }
    PyGILState_Release(state);
    return status;
}

static void evaluation_free(PyObject *self) {
    Evaluation *e = (Evaluation *)self;
    PyTypeObject *type = Py_TYPE(self);
    freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
    while (e->opened > 0) PyBuffer_Release(&e->views[--e->opened]);
    PyMem_Free(e->views);
    PyMem_Free(e->memory);
    Py_XDECREF(e->call);
    Py_XDECREF(e->examine);
    Py_XDECREF(e->owner);
    release(self);
    Py_DECREF(type);
}

static PyType_Slot evaluation_slots[] = {
    {Py_tp_doc, "A function of a model that C evaluates; made by `compiled` or `interpreted`."},
    {Py_tp_dealloc, evaluation_free},
    {0, NULL},
};
static PyType_Spec evaluation_spec = {"mbs.core._core.Evaluation", sizeof(Evaluation), 0,
                                      Py_TPFLAGS_DEFAULT, evaluation_slots};

typedef struct {
    PyTypeObject *evaluation, *integration;
} module_state;

static module_state *state_of(PyObject *module) { return PyModule_GetState(module); }

static Evaluation *new_evaluation(PyObject *module) {
    PyTypeObject *type = state_of(module)->evaluation;
    allocfunc allocate = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
    return (Evaluation *)allocate(type, 0);
}

static int take_function(PyObject *module, PyObject *one, model_function *to) {
    if (one == Py_None) return 0;
    if (!PyObject_TypeCheck(one, state_of(module)->evaluation)) {
        PyErr_SetString(PyExc_TypeError, "a function is an Evaluation or None");
        return 1;
    }
    *to = ((Evaluation *)one)->function;
    return 0;
}

static PyObject *compiled(PyObject *module, PyObject *args) {
    unsigned long long address;
    Py_ssize_t n_arg, n_res, n_iw, n_w;
    int inputs, outputs;
    compiled_function f;
    Evaluation *e;
    char *memory;
    if (!PyArg_ParseTuple(args, "K(ii)(nnnn)", &address, &inputs, &outputs, &n_arg, &n_res, &n_iw,
                          &n_w))
        return NULL;
    if (!(e = new_evaluation(module))) return NULL;
    memory = PyMem_Calloc((size_t)(n_arg + n_res + n_iw + n_w) + 1, sizeof(double));
    if (!memory) {
        Py_DECREF(e);
        return PyErr_NoMemory();
    }
    e->memory = memory;
    memset(&f, 0, sizeof f);
    f.w = (double *)memory;
    f.iw = (long long *)(f.w + n_w);
    f.arg = (const double **)(f.iw + n_iw);
    f.res = (double **)(f.arg + n_arg);
    f.inputs = inputs;
    f.outputs = outputs;
    memcpy(&f.code, &address, sizeof f.code);
    e->compiled = f;
    e->function.evaluate = compiled_evaluate;
    e->function.self = &e->compiled;
    return (PyObject *)e;
}

static int open_all(Evaluation *e, PyObject *arrays) {
    Py_ssize_t k, count = PyTuple_Size(arrays);
    for (k = 0; k < count; k++) {
        PyObject *array = PyTuple_GetItem(arrays, k);
        if (PyObject_GetBuffer(array, &e->views[e->opened], PyBUF_WRITABLE)) return 1;
        e->opened++;
    }
    return 0;
}

static PyObject *interpreted(PyObject *module, PyObject *args) {
    PyObject *call, *examine, *owner, *inputs, *outputs;
    Evaluation *e;
    if (!PyArg_ParseTuple(args, "OOOO!O!", &call, &examine, &owner, &PyTuple_Type, &inputs,
                          &PyTuple_Type, &outputs))
        return NULL;
    if (!(e = new_evaluation(module))) return NULL;
    e->inputs = (int)PyTuple_Size(inputs);
    e->outputs = (int)PyTuple_Size(outputs);
    e->views = PyMem_Calloc((size_t)(e->inputs + e->outputs) + 1, sizeof *e->views);
    if (!e->views) PyErr_NoMemory();
    if (!e->views || open_all(e, inputs) || open_all(e, outputs)) {
        Py_DECREF(e);
        return NULL;
    }
    Py_INCREF(call);
    Py_INCREF(examine);
    Py_INCREF(owner);
    e->call = call;
    e->examine = examine;
    e->owner = owner;
    e->function.evaluate = interpreted_evaluate;
    e->function.self = e;
    return (PyObject *)e;
}

/* Integration: a driver and the arrays that it reads. */

enum { FUNCTIONS = 10, VIEWS = 8 };

typedef struct {
    PyObject_HEAD
    driver *driver;
    driver_model model;
    PyObject *functions;
    Py_buffer views[VIEWS];
    int opened;
    long done; /* rows of the table that are filled */
} Integration;

static void integration_free(PyObject *self) {
    Integration *i = (Integration *)self;
    PyTypeObject *type = Py_TYPE(self);
    freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
    driver_free(i->driver);
    while (i->opened > 0) PyBuffer_Release(&i->views[--i->opened]);
    Py_XDECREF(i->functions);
    release(self);
    Py_DECREF(type);
}

/* Memory of an array, which stays open as long as the integration. NULL for None or an error. */
static const void *memory_of(Integration *i, PyObject *array) {
    Py_buffer *view = &i->views[i->opened];
    if (array == Py_None || PyObject_GetBuffer(array, view, PyBUF_SIMPLE)) return NULL;
    i->opened++;
    return view->buf;
}

static int take_functions(PyObject *module, driver_model *model, PyObject *functions) {
    model_function *const to[FUNCTIONS] = {
        &model->rhs,  &model->project,    &model->jacobian, &model->indicators, &model->rates,
        &model->jump, &model->approaches, &model->rows,     &model->forces,     &model->regularity,
    };
    int k;
    if (PyTuple_Size(functions) != FUNCTIONS) {
        if (!PyErr_Occurred()) PyErr_Format(PyExc_ValueError, "give %d functions", FUNCTIONS);
        return 1;
    }
    for (k = 0; k < FUNCTIONS; k++)
        if (take_function(module, PyTuple_GetItem(functions, k), to[k])) return 1;
    return 0;
}

static int take_passage(Integration *i, PyObject *passage) {
    passage_size *z = &i->model.size;
    passage_patterns *patterns = &i->model.patterns;
    PyObject *of[4];
    if (passage == Py_None) return 0;
    if (!PyArg_ParseTuple(passage, "(iiiiiii)(OOOO)d", &z->nq, &z->nv, &z->nz, &z->positions,
                          &z->anchors, &z->speeds, &z->moving, of, of + 1, of + 2, of + 3,
                          &i->model.typical))
        return 1;
    patterns->slope = memory_of(i, of[0]);
    patterns->J = memory_of(i, of[1]);
    patterns->N = memory_of(i, of[2]);
    patterns->M = memory_of(i, of[3]);
    return PyErr_Occurred() != NULL;
}

static int take_control(Integration *i, driver_control *control, PyObject *factors, PyObject *stops,
                        PyObject *jumps) {
    control->absolute = memory_of(i, factors);
    if (control->absolute) control->relative = control->absolute + i->model.n;
    control->stops = memory_of(i, stops);
    if (control->stops)
        control->n_stops = (long)(i->views[i->opened - 1].len / (Py_ssize_t)sizeof(double));
    control->jumps = memory_of(i, jumps);
    return PyErr_Occurred() != NULL;
}

static PyObject *integration(PyObject *module, PyObject *args) {
    PyTypeObject *type = state_of(module)->integration;
    allocfunc allocate = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
    Integration *i = (Integration *)allocate(type, 0);
    PyObject *functions, *passage, *p, *factors, *stops, *jumps;
    driver_control control;
    driver_model *m;
    const double *parameters;
    double t;
    if (!i) return NULL;
    m = &i->model;
    memset(&control, 0, sizeof control);
    if (!PyArg_ParseTuple(args, "O!(iiii)OO(dddd)O(OO)d", &PyTuple_Type, &functions, &m->n, &m->n_p,
                          &m->n_modes, &m->n_indicators, &passage, &p, &control.rtol, &control.atol,
                          &control.max_step, &control.first_step, &factors, &stops, &jumps, &t) ||
        take_functions(module, m, functions) || take_passage(i, passage) ||
        !(parameters = memory_of(i, p)) || take_control(i, &control, factors, stops, jumps)) {
        Py_DECREF(i);
        return NULL;
    }
    Py_INCREF(functions);
    i->functions = functions;
    i->driver = driver_new(m, parameters, &control, t);
    if (!i->driver) {
        Py_DECREF(i);
        return PyErr_NoMemory();
    }
    return (PyObject *)i;
}

static PyObject *replace(PyObject *self, PyObject *args) {
    Integration *i = (Integration *)self;
    PyObject *module, *functions, *before = i->functions;
    driver_model model = i->model;
    if (!PyArg_ParseTuple(args, "OO!", &module, &PyTuple_Type, &functions)) return NULL;
    if (take_functions(module, &model, functions)) return NULL;
    Py_INCREF(functions);
    i->functions = functions;
    i->model = model;
    driver_replace(i->driver, &model);
    Py_DECREF(before);
    Py_RETURN_NONE;
}

static PyObject *begin(PyObject *self, PyObject *args) {
    Integration *i = (Integration *)self;
    Py_buffer x;
    int status;
    if (!PyArg_ParseTuple(args, "w*", &x)) return NULL;
    Py_BEGIN_ALLOW_THREADS
    status = driver_begin(i->driver, x.buf);
    Py_END_ALLOW_THREADS
    PyBuffer_Release(&x);
    return PyErr_Occurred() ? NULL : PyLong_FromLong(status);
}

static PyObject *leaves(PyObject *self, PyObject *args) {
    Integration *i = (Integration *)self;
    Py_buffer x, slope;
    int answer;
    if (!PyArg_ParseTuple(args, "y*w*", &x, &slope)) return NULL;
    Py_BEGIN_ALLOW_THREADS
    answer = driver_leaves(i->driver, x.buf, slope.buf);
    Py_END_ALLOW_THREADS
    PyBuffer_Release(&x);
    PyBuffer_Release(&slope);
    return PyErr_Occurred() ? NULL : PyBool_FromLong(answer);
}

static PyObject *fill(PyObject *self, PyObject *args) {
    Integration *i = (Integration *)self;
    Py_buffer x, times, table;
    long budget, count;
    int status;
    if (!PyArg_ParseTuple(args, "w*y*w*l", &x, &times, &table, &budget)) return NULL;
    count = (long)(times.len / (Py_ssize_t)sizeof(double));
    Py_BEGIN_ALLOW_THREADS
    status = driver_table(i->driver, x.buf, times.buf, count, table.buf, &i->done, budget);
    Py_END_ALLOW_THREADS
    PyBuffer_Release(&x);
    PyBuffer_Release(&times);
    PyBuffer_Release(&table);
    return PyErr_Occurred() ? NULL : PyLong_FromLong(status);
}

static PyObject *event(PyObject *self, PyObject *args) {
    Integration *i = (Integration *)self;
    Py_buffer fired, modes;
    if (!PyArg_ParseTuple(args, "w*w*", &fired, &modes)) return NULL;
    memcpy(fired.buf, driver_fired(i->driver), (size_t)fired.len);
    memcpy(modes.buf, driver_modes(i->driver), (size_t)modes.len);
    PyBuffer_Release(&fired);
    PyBuffer_Release(&modes);
    Py_RETURN_NONE;
}

static PyObject *time_of(PyObject *self, void *closure) {
    (void)closure;
    return PyFloat_FromDouble(driver_time(((Integration *)self)->driver));
}

static PyObject *step_of(PyObject *self, void *closure) {
    (void)closure;
    return PyFloat_FromDouble(driver_step(((Integration *)self)->driver));
}

static PyObject *done_of(PyObject *self, void *closure) {
    (void)closure;
    return PyLong_FromLong(((Integration *)self)->done);
}

static PyMethodDef integration_methods[] = {
    {"replace", replace, METH_VARARGS, "replace(module, functions): evaluate others from now on."},
    {"begin", begin, METH_VARARGS, "begin(x) -> status: project the first state."},
    {"leaves", leaves, METH_VARARGS, "leaves(x, slope) -> bool: whether x is singular."},
    {"fill", fill, METH_VARARGS, "fill(x, times, table, budget) -> status."},
    {"event", event, METH_VARARGS, "event(fired, modes): copy those of the last event."},
    {NULL, NULL, 0, NULL},
};
static PyGetSetDef integration_values[] = {
    {"time", time_of, NULL, "Time that was reached [s].", NULL},
    {"done", done_of, NULL, "Number of rows of the table that are filled.", NULL},
    {"step", step_of, NULL, "Next step that error control requires [s].", NULL},
    {NULL, NULL, NULL, NULL, NULL},
};
static PyType_Slot integration_slots[] = {
    {Py_tp_doc, "An integration in progress; made by `integration`."},
    {Py_tp_dealloc, integration_free},
    {Py_tp_methods, integration_methods},
    {Py_tp_getset, integration_values},
    {0, NULL},
};
static PyType_Spec integration_spec = {"mbs.core._core.Integration", sizeof(Integration), 0,
                                       Py_TPFLAGS_DEFAULT, integration_slots};

/* Least squares. */

static PyObject *py_shortest_solution(PyObject *module, PyObject *args) {
    Py_buffer A, b, x;
    double gap;
    int failed;
    (void)module;
    if (!PyArg_ParseTuple(args, "y*y*dw*", &A, &b, &gap, &x)) return NULL;
    Py_BEGIN_ALLOW_THREADS
    failed = shortest_solution((int)(b.len / (Py_ssize_t)sizeof(double)),
                               (int)(x.len / (Py_ssize_t)sizeof(double)), A.buf, b.buf, gap, x.buf);
    Py_END_ALLOW_THREADS
    PyBuffer_Release(&A);
    PyBuffer_Release(&b);
    PyBuffer_Release(&x);
    if (failed) return PyErr_NoMemory();
    Py_RETURN_NONE;
}

static PyObject *py_gauss_newton(PyObject *module, PyObject *args) {
    enum { VIEWED = 8 };
    PyObject *equations, *values, *step;
    Py_buffer v[VIEWED];
    least_squares s;
    double residual = 0.0;
    int status, k;
    memset(&s, 0, sizeof s);
    if (!PyArg_ParseTuple(args, "(OOO)(w*y*w*w*)(y*y*y*y*)di", &equations, &values, &step, v, v + 1,
                          v + 2, v + 3, v + 4, v + 5, v + 6, v + 7, &s.gap, &s.iterations))
        return NULL;
    s.q = v[0].buf;
    s.p = v[1].buf;
    s.r = v[2].buf;
    s.e = v[3].buf;
    s.free = v[4].buf;
    s.row = v[5].buf;
    s.column = v[6].buf;
    s.tolerance = v[7].buf;
    s.size = (int)(v[0].len / (Py_ssize_t)sizeof(double));
    s.rows = (int)(v[2].len / (Py_ssize_t)sizeof(double));
    s.elements = (int)(v[3].len / (Py_ssize_t)sizeof(double));
    s.unknowns = (int)(v[4].len / (Py_ssize_t)sizeof(int));
    if (take_function(module, equations, &s.equations) ||
        take_function(module, values, &s.values) || take_function(module, step, &s.step))
        status = LEAST_SQUARES_FAILED;
    else {
        Py_BEGIN_ALLOW_THREADS
        status = gauss_newton(&s, &residual);
        Py_END_ALLOW_THREADS
    }
    for (k = 0; k < VIEWED; k++) PyBuffer_Release(&v[k]);
    return PyErr_Occurred() ? NULL : Py_BuildValue("id", status, residual);
}

/* The module. */

static PyMethodDef methods[] = {
    {"compiled", compiled, METH_VARARGS,
     "compiled(address, (inputs, outputs), (arg, res, iw, w)) -> Evaluation of machine code."},
    {"interpreted", interpreted, METH_VARARGS,
     "interpreted(call, examine, owner, inputs, outputs) -> Evaluation of a bound"
     " casadi.Function."},
    {"array_call", array_call_new, METH_VARARGS, "See mbs.native.array_calls.array_builtin."},
    {"shortest_solution", py_shortest_solution, METH_VARARGS,
     "shortest_solution(A, b, gap, x): see least_squares.h."},
    {"gauss_newton", py_gauss_newton, METH_VARARGS,
     "gauss_newton((equations, values, step), (q, p, r, e), (free, row, column, tolerance), gap,"
     " iterations) -> (status, residual): see least_squares.h."},
    {"integration", integration, METH_VARARGS,
     "integration(functions, sizes, passage, p, tolerances, factors, (stops, jumps), t) ->"
     " Integration: see driver.h."},
    {NULL, NULL, 0, NULL},
};

static int execute(PyObject *module) {
    module_state *state = state_of(module);
    state->evaluation = (PyTypeObject *)PyType_FromModuleAndSpec(module, &evaluation_spec, NULL);
    state->integration = (PyTypeObject *)PyType_FromModuleAndSpec(module, &integration_spec, NULL);
    if (!state->evaluation || !state->integration) return -1;
    return PyModule_AddStringConstant(module, "SOURCES", CORE_SOURCES);
}

static PyModuleDef_Slot slots[] = {{Py_mod_exec, execute}, {0, NULL}};
static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    "_core",
    "The run-time library of mbs.",
    sizeof(module_state),
    methods,
    slots,
    NULL,
    NULL,
    NULL,
};

PyMODINIT_FUNC PyInit__core(void);
PyMODINIT_FUNC PyInit__core(void) { return PyModuleDef_Init(&definition); }
