/* A builtin of Python that calls machine code on numbers without conversions in Python.
 *
 * Arrays of doubles whose columns are contiguous in memory are read in place. Other arrays, lists
 * and numbers are gathered into work space. The builtin returns None for arguments that it does not
 * take. The caller then uses another call. */
#define PY_SSIZE_T_CLEAN
#include "array_call.h"

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define MOST 64    /* inputs, and outputs */
#define STACK 2048 /* doubles of work space on the stack; beyond, on the heap */

typedef struct {
    long long rows;
    long long columns;
    long long stored; /* elements that the code knows; fewer than rows x columns if sparse */
    const long long *indices; /* of each stored element in the dense array, or NULL */
} shape;

typedef struct {
    int (*evaluate)(const double **, double **, long long *, double *, int);
    int (*checkout)(void);
    void (*release)(int);
    PyObject *array_type;  /* numpy.ndarray */
    PyObject *masked_type; /* numpy.ma.MaskedArray, whose mask a buffer does not show */
    PyObject *empty;       /* numpy.empty */
    PyObject *new_[MOST];  /* its arguments for each output */
    PyObject *guard; /* NULL, or what holds the function that gives 1 where inputs are taken */
    long long guarded[MOST]; /* the inputs of which it is asked */
    long long inputs;
    long long outputs;
    int finite;          /* whether inputs and results must be numbers */
    long long arguments; /* pointers that the code works with */
    long long results;
    long long integers;
    long long reals;
    long long space; /* doubles of room for a call; counted here */
    shape in[MOST];
    shape out[MOST];
} function;

/* Where the element (r, c) of a matrix is in memory, and what it is. */
typedef struct {
    char *data;
    Py_ssize_t row;
    Py_ssize_t column;
    Py_ssize_t item;
    char kind; /* i, u or f */
    int swapped;
} place;

typedef struct {
    Py_buffer in[MOST]; /* of inputs that are read where they are */
    Py_buffer out[MOST];
    place to[MOST]; /* of outputs that are written there after the call */
    PyObject *arrays[MOST];
    int opened; /* views of inputs */
    int made;   /* outputs that are in Py_buffer */
} call;

static const char LABEL[] = "mbs.core.array_call";

/* What an array holds, by the format of a buffer. */

static int little(void) {
    const int one = 1;
    return *(const char *)&one;
}

static int understood(const Py_buffer *v, place *p) {
    const char *f = v->format;
    p->item = v->itemsize;
    p->swapped = 0;
    if (!f) return 0;
    if (*f && strchr("@=^", *f)) {
        ++f;
    } else if (*f && strchr("<>!", *f)) {
        p->swapped = (*f == '<') != little();
        ++f;
    }
    if (!*f || f[1]) return 0;
    p->kind = strchr("bhilqn", *f)    ? 'i'
              : strchr("BHILQN?", *f) ? 'u'
              : strchr("efdg", *f)    ? 'f'
                                      : 0;
    if (p->kind == 'f') {
        if (v->itemsize == 2 || v->itemsize == 4 || v->itemsize == 8) return 1;
        return v->itemsize == (Py_ssize_t)sizeof(long double) && !p->swapped;
    }
    return p->kind &&
           (v->itemsize == 1 || v->itemsize == 2 || v->itemsize == 4 || v->itemsize == 8);
}

static double half(uint16_t bits) {
    const int exponent = bits >> 10 & 31, fraction = bits & 1023;
    double x = exponent ? ldexp(1024 + fraction, exponent - 25) : ldexp(fraction, -24);
    if (exponent == 31) x = fraction ? NAN : INFINITY;
    return bits >> 15 ? -x : x;
}

#define READ(type)                \
    do {                          \
        type x;                   \
        memcpy(&x, at, sizeof x); \
        return (double)x;         \
    } while (0)

static double read_number(const place *p, const char *at) {
    char turned[8];
    if (p->swapped) {
        for (Py_ssize_t k = 0; k < p->item; ++k) turned[k] = at[p->item - 1 - k];
        at = turned;
    }
    if (p->kind == 'f') {
        if (p->item == 8) READ(double);
        if (p->item == 4) READ(float);
        if (p->item != 2) READ(long double);
        uint16_t bits;
        memcpy(&bits, at, 2);
        return half(bits);
    }
    if (p->kind == 'i') {
        if (p->item == 8) READ(int64_t);
        if (p->item == 4) READ(int32_t);
        if (p->item == 2) READ(int16_t);
        READ(int8_t);
    }
    if (p->item == 8) READ(uint64_t);
    if (p->item == 4) READ(uint32_t);
    if (p->item == 2) READ(uint16_t);
    READ(uint8_t);
}

/* Where the elements of a matrix are in an array: of its shape, a line of either direction, or,
 * where one may stand for all, a single element. */
static int placed(const Py_buffer *v, const shape *s, int one_for_all, place *p) {
    const long long count = s->rows * s->columns;
    const int line = s->rows == 1 || s->columns == 1;
    const Py_ssize_t *n = v->shape, *step = v->strides;
    p->data = v->buf;
    p->row = p->column = 0;
    if (v->ndim > 2) return 0;
    if (v->len == v->itemsize && (count == 1 || (one_for_all && count > 0))) return 1;
    if (v->len == 0 || count == 0) return v->len == 0 && count == 0 && v->ndim > 0;
    if (v->ndim == 0) return 0;
    if (v->ndim == 1) {
        p->row = p->column = step[0];
        return line && n[0] == count;
    }
    if (n[0] == s->rows && n[1] == s->columns) {
        p->row = step[0];
        p->column = step[1];
        return 1;
    }
    p->row = step[1];
    p->column = step[0];
    return line && n[0] == s->columns && n[1] == s->rows;
}

/* Whether the code can read or write an array where it is. */
static int in_place(const place *p, const shape *s) {
    const Py_ssize_t item = sizeof(double);
    return !s->indices && p->kind == 'f' && p->item == item && !p->swapped &&
           (uintptr_t)p->data % sizeof(double) == 0 && (s->rows <= 1 || p->row == item) &&
           (s->columns <= 1 || p->column == item * s->rows);
}

static char *element(const place *p, const shape *s, long long k) {
    const long long index = s->indices ? s->indices[k] : k;
    return p->data + index % s->rows * p->row + index / s->rows * p->column;
}

static void gather(const place *p, const shape *s, double *to) {
    if (!s->indices) {
        for (long long c = 0; c < s->columns; ++c)
            for (long long r = 0; r < s->rows; ++r)
                *to++ = read_number(p, p->data + r * p->row + c * p->column);
        return;
    }
    for (long long k = 0; k < s->stored; ++k) to[k] = read_number(p, element(p, s, k));
}

static void scatter(const double *from, const shape *s, const place *p) {
    const double zero = 0;
    for (long long c = 0; s->indices && c < s->columns; ++c)
        for (long long r = 0; r < s->rows; ++r)
            memcpy(p->data + r * p->row + c * p->column, &zero, sizeof zero);
    for (long long k = 0; k < s->stored; ++k) memcpy(element(p, s, k), &from[k], sizeof *from);
}

/* What objects are. */

typedef enum { OTHER, NUMBER, ARRAY, LIST, TUPLE } sort;

static sort sort_of(const function *f, PyObject *x) {
    PyTypeObject *type = Py_TYPE(x);
    if ((PyObject *)type == f->array_type) return ARRAY;
    if (type == &PyFloat_Type) return NUMBER;
    if (type == &PyList_Type) return LIST;
    if (PyType_IsSubtype(type, &PyFloat_Type) || PyType_IsSubtype(type, &PyLong_Type))
        return NUMBER;
    if (PyType_IsSubtype(type, &PyTuple_Type)) return TUPLE;
    if (PyType_IsSubtype(type, &PyList_Type)) return LIST;
    if (!PyObject_CheckBuffer(x)) return OTHER;
    if (PyType_IsSubtype(type, (PyTypeObject *)f->masked_type)) return OTHER;
    return PyType_IsSubtype(type, &PyBytes_Type) ? OTHER : ARRAY;
}

static int opened(PyObject *x, Py_buffer *v, int flags) {
    if (PyObject_GetBuffer(x, v, PyBUF_STRIDES | PyBUF_FORMAT | flags) == 0) return 1;
    PyErr_Clear();
    return 0;
}

static int number(PyObject *x, sort of, double *to) {
    if (of != NUMBER) return 0;
    *to = PyFloat_AsDouble(x);
    if (*to != -1.0 || !PyErr_Occurred()) return 1;
    PyErr_Clear(); /* an integer that no double holds */
    return 0;
}

/* The numbers in an array, matched to a shape, gathered. */
static int numbers(PyObject *x, const shape *s, int one_for_all, double *to) {
    Py_buffer v;
    place p;
    if (!opened(x, &v, 0)) return 0;
    const int done = understood(&v, &p) && placed(&v, s, one_for_all, &p);
    if (done) gather(&p, s, to);
    PyBuffer_Release(&v);
    return done;
}

static Py_ssize_t length(PyObject *x, sort of) {
    return of == LIST ? PyList_Size(x) : PyTuple_Size(x);
}

static PyObject *item(PyObject *x, sort of, Py_ssize_t k) {
    return of == LIST ? PyList_GetItem(x, k) : PyTuple_GetItem(x, k);
}

/* What to answer of a list that the buffer of one of its items has made shorter. */
static int shrunk(void) {
    PyErr_Clear();
    return 0;
}

/* A list of numbers, of doubles at a distance in `to`. */
static int flat(const function *f, PyObject *x, sort of, Py_ssize_t count, Py_ssize_t step,
                double *to) {
    const shape one = {1, 1, 1, NULL};
    if (length(x, of) != count) return 0;
    for (Py_ssize_t k = 0; k < count; ++k) {
        PyObject *each = item(x, of, k);
        if (!each) return shrunk();
        const sort what = sort_of(f, each);
        if (!number(each, what, to + k * step) &&
            !(what == ARRAY && numbers(each, &one, 0, to + k * step)))
            return 0;
    }
    return 1;
}

/* A list of numbers, or of rows that are lists or arrays, as a dense matrix. */
static int nested(const function *f, PyObject *x, sort of, const shape *s, double *to,
                  double *row) {
    const int line = s->rows == 1 || s->columns == 1;
    const Py_ssize_t given = length(x, of), count = (Py_ssize_t)(s->rows * s->columns);
    if (s->indices) return 0;
    if (given == 0) return count == 0;
    const sort first = sort_of(f, item(x, of, 0));
    if (line && given == count && first == NUMBER) return flat(f, x, of, count, 1, to);
    if (line && given == count && flat(f, x, of, count, 1, to)) return 1;
    const int turned = given != (Py_ssize_t)s->rows;
    if (turned && !(line && given == (Py_ssize_t)s->columns)) return 0;
    const Py_ssize_t width = (Py_ssize_t)(turned ? s->rows : s->columns);
    const Py_ssize_t step = turned ? 1 : (Py_ssize_t)s->rows,
                     next = turned ? (Py_ssize_t)s->rows : 1;
    const shape of_row = {1, width, width, NULL};
    for (Py_ssize_t k = 0; k < given; ++k) {
        PyObject *each = item(x, of, k);
        if (!each) return shrunk();
        const sort what = sort_of(f, each);
        if (what == LIST || what == TUPLE) {
            if (!flat(f, each, what, width, step, to + k * next)) return 0;
            continue;
        }
        if (what != ARRAY || !numbers(each, &of_row, 0, row)) return 0;
        for (Py_ssize_t c = 0; c < width; ++c) to[k * next + c * step] = row[c];
    }
    return 1;
}

/* One input: where the code finds its numbers, or NULL. `room` is for what must be gathered. */
static const double *input(const function *f, call *c, PyObject *x, const shape *s, double *room) {
    const sort what = sort_of(f, x);
    if (what == ARRAY) {
        Py_buffer *v = &c->in[c->opened];
        place p;
        if (!opened(x, v, 0)) return NULL;
        if (!understood(v, &p) || !placed(v, s, !f->finite, &p)) {
            PyBuffer_Release(v);
            return NULL;
        }
        if (s->stored && in_place(&p, s)) {
            ++c->opened;
            return v->buf;
        }
        gather(&p, s, room);
        PyBuffer_Release(v);
        return room;
    }
    if (what == LIST || what == TUPLE) {
        double *row = room + s->stored;
        return nested(f, x, what, s, room, row) ? room : NULL;
    }
    double value;
    const long long count = s->rows * s->columns;
    if (count == 0 || !number(x, what, &value)) return NULL;
    if (count != 1 && f->finite && value != 0) return NULL; /* a model takes zero for all alone */
    for (long long k = 0; k < s->stored; ++k) room[k] = value;
    return room;
}

static int apart(const Py_buffer *a, const Py_buffer *b) {
    const char *p = a->buf, *q = b->buf;
    return p + a->len <= q || q + b->len <= p;
}

static int regular(const double *x, long long count) {
    double sum[4] = {0, 0, 0, 0};
    long long k = 0;
    for (; k + 4 <= count; k += 4)
        for (int i = 0; i < 4; ++i) sum[i] += x[k + i] * 0.0;
    for (; k < count; ++k) sum[0] += x[k] * 0.0;
    return (sum[0] + sum[1]) + (sum[2] + sum[3]) == 0.0;
}

/* One output in an array: where the code writes its numbers, or NULL. */
static double *output(call *c, PyObject *array, const shape *s, double *room) {
    Py_buffer *v = &c->out[c->made];
    place *p = &c->to[c->made];
    if (!opened(array, v, PyBUF_WRITABLE)) return NULL;
    if (!understood(v, p) || p->kind != 'f' || p->item != 8 || p->swapped || !placed(v, s, 0, p)) {
        PyBuffer_Release(v);
        return NULL;
    }
    int direct = in_place(p, s);
    for (int i = 0; direct && i < c->opened; ++i) direct = apart(v, &c->in[i]);
    for (int i = 0; direct && i < c->made; ++i) direct = apart(v, &c->out[i]);
    Py_INCREF(array);
    c->arrays[c->made++] = array;
    return direct ? v->buf : room;
}

/* Whether the inputs are taken; in the room of outputs that are not yet written. */
static int taken(const function *f, const double *const *arguments, double *space,
                 long long *integers) {
    const function *g = f->guard ? PyCapsule_GetPointer(f->guard, LABEL) : NULL;
    if (!g) return !f->guard;
    const double **in = (const double **)space;
    double **out = (double **)(space + g->arguments), *w = space + g->arguments + g->results;
    double holds = 0;
    for (int k = 0; k < g->inputs; ++k) in[k] = arguments[f->guarded[k]];
    out[0] = &holds;
    const int memory = g->checkout ? g->checkout() : 0;
    if (memory < 0) return 0;
    const int failed = g->evaluate(in, out, integers, w, memory);
    if (g->release) g->release(memory);
    return !failed && holds == 1.0;
}

/* Room: pointers, work space of the code, gathered inputs, outputs that are written elsewhere. */
static int run(const function *f, call *c, PyObject *const *given, int brought, double *space,
               long long *integers) {
    const double **arguments = (const double **)space;
    double **results = (double **)(space + f->arguments);
    double *w = space + f->arguments + f->results, *room = w + f->reals;
    for (int k = 0; k < f->inputs; ++k) {
        const shape *s = &f->in[k];
        arguments[k] = input(f, c, given[k], s, room);
        if (!arguments[k] || (f->finite && !regular(arguments[k], s->stored))) return 0;
        room += s->stored;
    }
    if (!taken(f, arguments, room, integers)) return 0;
    for (int k = 0; k < f->outputs; ++k) {
        PyObject *array =
            brought ? given[f->inputs + k] : PyObject_CallObject(f->empty, f->new_[k]);
        if (!array) {
            PyErr_Clear();
            return 0;
        }
        results[k] = output(c, array, &f->out[k], room);
        if (!brought) Py_DECREF(array);
        if (!results[k]) return 0;
        room += f->out[k].stored;
    }
    double *written[MOST];
    memcpy(written, results, (size_t)f->outputs * sizeof *written);
    const int memory = f->checkout ? f->checkout() : 0;
    if (memory < 0) return 0;
    const int failed = f->evaluate(arguments, results, integers, w, memory);
    if (f->release) f->release(memory);
    if (failed) return 0;
    for (int k = 0; k < f->outputs; ++k) {
        const shape *s = &f->out[k];
        if (f->finite && !regular(written[k], s->stored)) return 0;
        if (written[k] != c->out[k].buf) scatter(written[k], s, &c->to[k]);
    }
    return 1;
}

static long long space_of(const function *f) {
    long long widest = 0, count = f->arguments + f->results + f->reals;
    for (int k = 0; k < f->inputs; ++k) {
        const shape *s = &f->in[k];
        const long long width = s->rows > s->columns ? s->rows : s->columns;
        widest = width > widest ? width : widest;
        count += s->stored;
    }
    for (int k = 0; k < f->outputs; ++k) count += f->out[k].stored;
    const function *g = f->guard ? PyCapsule_GetPointer(f->guard, LABEL) : NULL;
    return count + widest /* a row of a list */ + (g ? g->arguments + g->results + g->reals : 0);
}

static PyObject *answer(const function *f, PyObject **arrays) {
    if (f->outputs == 1) return arrays[0];
    PyObject *tuple = PyTuple_New((Py_ssize_t)f->outputs);
    for (int k = 0; k < f->outputs; ++k) {
        if (tuple)
            PyTuple_SetItem(tuple, k, arrays[k]);
        else
            Py_DECREF(arrays[k]);
    }
    return tuple;
}

/* Takes the inputs, then either nothing or an array for each output. */
static PyObject *array_call(PyObject *self, PyObject *const *given, Py_ssize_t count) {
    const function *f = PyCapsule_GetPointer(self, LABEL);
    if (!f) return NULL;
    call c;
    c.opened = c.made = 0;
    double reals[STACK];
    long long integers[64];
    const int brought = count == f->inputs + f->outputs;
    double *w = f->space <= STACK ? reals : malloc((size_t)f->space * sizeof(double));
    long long *iw = f->integers <= 64 ? integers : malloc((size_t)f->integers * sizeof(long long));
    const int done =
        w && iw && (brought || count == f->inputs) && run(f, &c, given, brought, w, iw);
    if (w != reals) free(w);
    if (iw != integers) free(iw);
    for (int k = 0; k < c.opened; ++k) PyBuffer_Release(&c.in[k]);
    for (int k = 0; k < c.made; ++k) PyBuffer_Release(&c.out[k]);
    if (done) return answer(f, c.arrays);
    for (int k = 0; k < c.made; ++k) Py_DECREF(c.arrays[k]);
    Py_INCREF(Py_None);
    return Py_None;
}

static void forget(PyObject *capsule) {
    function *f = PyCapsule_GetPointer(capsule, LABEL);
    if (!f) return;
    Py_XDECREF(f->array_type);
    Py_XDECREF(f->masked_type);
    Py_XDECREF(f->empty);
    Py_XDECREF(f->guard);
    for (int k = 0; k < f->outputs; ++k) {
        Py_XDECREF(f->new_[k]);
        free((void *)f->out[k].indices);
    }
    for (int k = 0; k < f->inputs; ++k) free((void *)f->in[k].indices);
    free(f);
}

/* A shape from (rows, columns, stored, indices or None); 1: an exception is set. */
static int take_shape(PyObject *given, shape *s) {
    PyObject *indices;
    Py_buffer view;
    if (!PyArg_ParseTuple(given, "LLLO", &s->rows, &s->columns, &s->stored, &indices)) return 1;
    if (indices == Py_None) return 0;
    if (PyObject_GetBuffer(indices, &view, PyBUF_SIMPLE)) return 1;
    long long *copy = malloc((size_t)view.len + 1);
    if (copy) memcpy(copy, view.buf, (size_t)view.len);
    s->indices = copy;
    PyBuffer_Release(&view);
    if (!copy) PyErr_NoMemory();
    return !copy;
}

static int take_ports(function *f, PyObject *inputs, PyObject *outputs) {
    for (f->inputs = 0; f->inputs < PyTuple_Size(inputs); ++f->inputs)
        if (take_shape(PyTuple_GetItem(inputs, f->inputs), &f->in[f->inputs])) return 1;
    for (f->outputs = 0; f->outputs < PyTuple_Size(outputs); ++f->outputs) {
        PyObject *pair = PyTuple_GetItem(outputs, f->outputs);
        if (take_shape(PyTuple_GetItem(pair, 0), &f->out[f->outputs])) return 1;
        f->new_[f->outputs] = PyTuple_GetItem(pair, 1);
        Py_INCREF(f->new_[f->outputs]);
    }
    return 0;
}

static int take_guard(function *f, PyObject *builtin, PyObject *numbers) {
    if (builtin == Py_None) return 0;
    f->guard = PyObject_GetAttrString(builtin, "__self__"); /* the capsule of its function */
    const function *g = f->guard ? PyCapsule_GetPointer(f->guard, LABEL) : NULL;
    if (!g) return 1;
    for (Py_ssize_t k = 0; k < PyTuple_Size(numbers); ++k)
        f->guarded[k] = PyLong_AsLongLong(PyTuple_GetItem(numbers, k));
    if (g->integers > f->integers) f->integers = g->integers;
    return PyErr_Occurred() != NULL;
}

PyObject *array_call_new(PyObject *module, PyObject *args) {
    static PyMethodDef description = {"array_call", (PyCFunction)(void (*)(void))array_call,
                                      METH_FASTCALL, NULL};
    unsigned long long evaluate, checkout, release;
    PyObject *inputs, *outputs, *guard, *guarded, *capsule, *builtin;
    function *f = calloc(1, sizeof *f);
    (void)module;
    if (!f) return PyErr_NoMemory();
    if (!(capsule = PyCapsule_New(f, LABEL, forget))) {
        free(f);
        return NULL;
    }
    if (!PyArg_ParseTuple(args, "(KKK)(LLLL)(OOO)O!O!pOO!", &evaluate, &checkout, &release,
                          &f->arguments, &f->results, &f->integers, &f->reals, &f->array_type,
                          &f->masked_type, &f->empty, &PyTuple_Type, &inputs, &PyTuple_Type,
                          &outputs, &f->finite, &guard, &PyTuple_Type, &guarded)) {
        f->array_type = f->masked_type = f->empty = NULL;
        Py_DECREF(capsule);
        return NULL;
    }
    Py_INCREF(f->array_type);
    Py_INCREF(f->masked_type);
    Py_INCREF(f->empty);
    memcpy(&f->evaluate, &evaluate, sizeof f->evaluate);
    memcpy(&f->checkout, &checkout, sizeof f->checkout);
    memcpy(&f->release, &release, sizeof f->release);
    if (take_ports(f, inputs, outputs) || take_guard(f, guard, guarded)) {
        Py_DECREF(capsule);
        return NULL;
    }
    f->space = space_of(f);
    builtin = PyCFunction_NewEx(&description, capsule, NULL);
    Py_DECREF(capsule);
    return builtin;
}
