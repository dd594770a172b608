/* A builtin of Python that calls one compiled function on arrays of doubles without copies.
 *
 * No header of Python is needed: the few functions of its stable interface come in a table. The
 * builtin answers None for whatever it does not take as it is; the caller then calls otherwise. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

#define MOST 32     /* inputs, outputs, and pointers that the code works with */
#define STACK 2048  /* doubles of work space on the stack; beyond, on the heap */

typedef struct object object;
typedef intptr_t size;

/* Py_buffer, part of the stable interface since Python 3.11. */
typedef struct {
  void *data;
  object *owner;
  size bytes;
  size item;
  int readonly;
  int dimensions;
  char *format;
  size *shape;
  size *strides;
  size *suboffsets;
  void *internal;
} view;

enum { WRITABLE = 0x1, FORMAT = 0x4, C_ORDER = 0x38, F_ORDER = 0x58 };

typedef struct {
  object *none;
  int (*get_buffer)(object *, view *, int);
  void (*release_buffer)(view *);
  void (*clear_error)(void);
  void (*increase)(object *);
  void (*decrease)(object *);
  object *(*call)(object *, object *);
  object *(*new_tuple)(size);
  int (*set_item)(object *, size, object *); /* PyTuple_SetItem keeps the reference */
  object *(*new_capsule)(void *, const char *, void (*)(object *));
  void *(*capsule_pointer)(object *, const char *);
  object *(*new_function)(void *, object *, object *);
} python;

typedef struct {
  long long rows;
  long long columns;
  long long stored;        /* elements that the code writes; fewer than rows x columns if sparse */
  const long long *indices; /* of each stored element in the dense array, or NULL */
} shape;

typedef struct {
  int (*evaluate)(const double **, double **, long long *, double *, int);
  int (*checkout)(void);
  void (*release)(int);
  object *empty;      /* numpy.empty */
  object *new_[MOST]; /* its arguments for each output */
  long long inputs;
  long long outputs;
  long long finite; /* whether inputs and results must be numbers */
  long long integers;
  long long reals;
  shape in[MOST];
  shape out[MOST];
} function;

typedef struct {
  view in[MOST];
  view out[MOST];
  object *arrays[MOST];
  int opened; /* inputs that are in view */
  int made;   /* outputs that are in view */
} call;

typedef struct {
  const char *name;
  object *(*code)(object *, object *const *, size);
  int flags;
  const char *doc;
} method;

static const char LABEL[] = "mbs.native.array_call";

static python py; /* set once, before anything else is called */

static int fits(const view *v, const shape *s) {
  const int line = s->rows == 1 || s->columns == 1;
  if (v->item != sizeof(double) || !v->format || strcmp(v->format, "d") != 0) return 0;
  if (v->bytes != (size)(s->rows * s->columns) * (size)sizeof(double)) return 0;
  if (v->dimensions < 2) return line;
  if (v->dimensions > 2) return 0;
  if (line) return v->shape[0] == 1 || v->shape[1] == 1;
  return v->shape[0] == s->rows && v->shape[1] == s->columns;
}

static int seen(object *array, view *v, const shape *s, int flags) {
  const int order = s->rows == 1 || s->columns == 1 ? C_ORDER : F_ORDER;
  if (py.get_buffer(array, v, order | FORMAT | flags) != 0) {
    py.clear_error();
    return 0;
  }
  if (fits(v, s)) return 1;
  py.release_buffer(v);
  return 0;
}

static int apart(const view *a, const view *b) {
  const char *p = a->data, *q = b->data;
  return p + a->bytes <= q || q + b->bytes <= p;
}

static int regular(const double *x, long long count) {
  double sum[4] = {0, 0, 0, 0};
  long long k = 0;
  for (; k + 4 <= count; k += 4)
    for (int i = 0; i < 4; ++i) sum[i] += x[k + i] * 0.0;
  for (; k < count; ++k) sum[0] += x[k] * 0.0;
  return (sum[0] + sum[1]) + (sum[2] + sum[3]) == 0.0;
}

static void scatter(const shape *s, const double *stored, double *dense) {
  memset(dense, 0, (size_t)(s->rows * s->columns) * sizeof(double));
  for (long long k = 0; k < s->stored; ++k) dense[s->indices[k]] = stored[k];
}

/* Runs the code in work space `w`, of which the first doubles hold sparse outputs. */
static int run(const function *f, const view *in, const view *out, double *w, long long *iw) {
  const double *arguments[MOST] = {0};
  double *results[MOST] = {0};
  for (int k = 0; k < f->inputs; ++k) {
    arguments[k] = in[k].data;
    if (f->finite && !regular(in[k].data, f->in[k].rows * f->in[k].columns)) return 0;
  }
  for (int k = 0; k < f->outputs; ++k) {
    results[k] = f->out[k].indices ? w : out[k].data;
    if (f->out[k].indices) w += f->out[k].stored;
  }
  double *sparse[MOST];
  memcpy(sparse, results, sizeof sparse);
  const int memory = f->checkout ? f->checkout() : 0;
  if (memory < 0) return 0;
  const int failed = f->evaluate(arguments, results, iw, w, memory);
  if (f->release) f->release(memory);
  if (failed) return 0;
  for (int k = 0; k < f->outputs; ++k) {
    const shape *s = &f->out[k];
    if (s->indices) scatter(s, sparse[k], out[k].data);
    if (f->finite && !regular(out[k].data, s->rows * s->columns)) return 0;
  }
  return 1;
}

static int run_in_space(const function *f, const view *in, const view *out) {
  double reals[STACK];
  long long integers[64];
  double *w = f->reals <= STACK ? reals : malloc((size_t)f->reals * sizeof(double));
  long long *iw =
      f->integers <= 64 ? integers : malloc((size_t)f->integers * sizeof(long long));
  const int done = w && iw && run(f, in, out, w, iw);
  if (w != reals) free(w);
  if (iw != integers) free(iw);
  return done;
}

static int open_inputs(const function *f, call *c, object *const *given) {
  while (c->opened < f->inputs && seen(given[c->opened], &c->in[c->opened], &f->in[c->opened], 0))
    ++c->opened;
  return c->opened == f->inputs;
}

static int make_outputs(const function *f, call *c) {
  for (; c->made < f->outputs; ++c->made) {
    object *array = py.call(f->empty, f->new_[c->made]);
    if (!array) {
      py.clear_error();
      return 0;
    }
    if (!seen(array, &c->out[c->made], &f->out[c->made], WRITABLE)) {
      py.decrease(array);
      return 0;
    }
    c->arrays[c->made] = array;
  }
  return 1;
}

/* Outputs that the caller brings: they may not share memory with anything else. */
static int open_outputs(const function *f, call *c, object *const *given) {
  for (; c->made < f->outputs; ++c->made) {
    view *v = &c->out[c->made];
    if (!seen(given[c->made], v, &f->out[c->made], WRITABLE)) return 0;
    py.increase(given[c->made]);
    c->arrays[c->made] = given[c->made];
    int free = 1;
    for (int i = 0; i < c->opened; ++i) free = free && apart(v, &c->in[i]);
    for (int i = 0; i < c->made; ++i) free = free && apart(v, &c->out[i]);
    if (!free) {
      ++c->made;
      return 0;
    }
  }
  return 1;
}

static object *answer(const function *f, object **arrays) {
  if (f->outputs == 1) return arrays[0];
  object *tuple = py.new_tuple((size)f->outputs);
  for (int k = 0; k < f->outputs; ++k) {
    if (tuple)
      py.set_item(tuple, k, arrays[k]);
    else
      py.decrease(arrays[k]);
  }
  return tuple;
}

/* Takes the inputs, then either nothing or an array for each output. */
static object *array_call(object *self, object *const *given, size count) {
  const function *f = py.capsule_pointer(self, LABEL);
  if (!f) return NULL;
  call c;
  c.opened = c.made = 0;
  const int brought = count == f->inputs + f->outputs;
  int done = (brought || count == f->inputs) && open_inputs(f, &c, given) &&
             (brought ? open_outputs(f, &c, given + f->inputs) : make_outputs(f, &c)) &&
             run_in_space(f, c.in, c.out);
  for (int k = 0; k < c.opened; ++k) py.release_buffer(&c.in[k]);
  for (int k = 0; k < c.made; ++k) py.release_buffer(&c.out[k]);
  if (done) return answer(f, c.arrays);
  for (int k = 0; k < c.made; ++k) py.decrease(c.arrays[k]);
  py.increase(py.none);
  return py.none;
}

static void forget(object *capsule) {
  function *f = py.capsule_pointer(capsule, LABEL);
  if (!f) return;
  py.decrease(f->empty);
  for (int k = 0; k < f->outputs; ++k) {
    py.decrease(f->new_[k]);
    free((void *)f->out[k].indices);
  }
  free(f);
}

/* A copy of its own of the indices of a sparse output; 0 without memory. */
static int own_indices(shape *s) {
  if (!s->indices) return 1;
  const size_t bytes = (size_t)s->stored * sizeof(long long);
  long long *copy = malloc(bytes ? bytes : 1);
  if (copy) memcpy(copy, s->indices, bytes);
  s->indices = copy;
  return copy != NULL;
}

EXPORT void mbs_setup(const python *table) { py = *table; }

/* The builtin of a function; needs the interpreter's lock, as all of the above. */
EXPORT object *mbs_builtin(const function *given) {
  static method description = {"array_call", array_call, 0x80 /* METH_FASTCALL */, NULL};
  function *f = malloc(sizeof *f);
  if (!f) return NULL;
  *f = *given;
  int complete = 1;
  py.increase(f->empty);
  for (int k = 0; k < f->outputs; ++k) {
    py.increase(f->new_[k]);
    complete = own_indices(&f->out[k]) && complete;
  }
  object *capsule = complete ? py.new_capsule(f, LABEL, forget) : NULL;
  if (!capsule) return NULL;
  object *builtin = py.new_function(&description, capsule, NULL);
  py.decrease(capsule);
  return builtin;
}
