/* A builtin of Python that calls one compiled function on numbers without conversions in Python.
 *
 * Arrays of doubles whose columns follow each other in memory are read where they are; other
 * arrays, lists and numbers are gathered into work space. No header of Python is needed: the few
 * functions of its stable interface come in a table. The builtin answers None for whatever it does
 * not take; the caller then calls otherwise. */
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

#define MOST 64     /* inputs, and outputs */
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

enum { WRITABLE = 0x1, FORMAT = 0x4, STRIDES = 0x18 };

typedef struct {
  object *none;
  object *array_type;  /* numpy.ndarray */
  object *masked_type; /* numpy.ma.MaskedArray, whose mask a buffer does not show */
  object *float_type;
  object *int_type;
  object *list_type;
  object *tuple_type;
  object *bytes_type;
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
  int (*check_buffer)(object *);
  object *(*type)(object *);
  int (*subtype)(object *, object *);
  double (*as_double)(object *);
  object *(*error)(void);
  object *(*list_item)(object *, size); /* borrowed, as that of a tuple */
  size (*list_size)(object *);
  object *(*tuple_item)(object *, size);
  size (*tuple_size)(object *);
} python;

typedef struct {
  long long rows;
  long long columns;
  long long stored;         /* elements that the code knows; fewer than rows x columns if sparse */
  const long long *indices; /* of each stored element in the dense array, or NULL */
} shape;

typedef struct {
  int (*evaluate)(const double **, double **, long long *, double *, int);
  int (*checkout)(void);
  void (*release)(int);
  object *empty;      /* numpy.empty */
  object *new_[MOST]; /* its arguments for each output */
  object *guard;      /* NULL, or what holds the function that gives 1 where inputs are taken */
  long long guarded[MOST]; /* the inputs of which it is asked */
  long long inputs;
  long long outputs;
  long long finite; /* whether inputs and results must be numbers */
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
  size row;
  size column;
  size item;
  char kind; /* i, u or f */
  int swapped;
} place;

typedef struct {
  view in[MOST]; /* of inputs that are read where they are */
  view out[MOST];
  place to[MOST]; /* of outputs that are written there after the call */
  object *arrays[MOST];
  int opened; /* views of inputs */
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

/* What an array holds, by the format of a buffer. */

static int little(void) {
  const int one = 1;
  return *(const char *)&one;
}

static int understood(const view *v, place *p) {
  const char *f = v->format;
  p->item = v->item;
  p->swapped = 0;
  if (!f) return 0;
  if (*f && strchr("@=^", *f)) {
    ++f;
  } else if (*f && strchr("<>!", *f)) {
    p->swapped = (*f == '<') != little();
    ++f;
  }
  if (!*f || f[1]) return 0;
  p->kind = strchr("bhilqn", *f) ? 'i' : strchr("BHILQN?", *f) ? 'u' : strchr("efdg", *f) ? 'f' : 0;
  if (p->kind == 'f') {
    if (v->item == 2 || v->item == 4 || v->item == 8) return 1;
    return v->item == (size)sizeof(long double) && !p->swapped;
  }
  return p->kind && (v->item == 1 || v->item == 2 || v->item == 4 || v->item == 8);
}

static double half(uint16_t bits) {
  const int exponent = bits >> 10 & 31, fraction = bits & 1023;
  double x = exponent ? ldexp(1024 + fraction, exponent - 25) : ldexp(fraction, -24);
  if (exponent == 31) x = fraction ? NAN : INFINITY;
  return bits >> 15 ? -x : x;
}

#define READ(type)                \
  do {                            \
    type x;                       \
    memcpy(&x, at, sizeof x);     \
    return (double)x;             \
  } while (0)

static double read_number(const place *p, const char *at) {
  char turned[8];
  if (p->swapped) {
    for (size k = 0; k < p->item; ++k) turned[k] = at[p->item - 1 - k];
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
static int placed(const view *v, const shape *s, int one_for_all, place *p) {
  const long long count = s->rows * s->columns;
  const int line = s->rows == 1 || s->columns == 1;
  const size *n = v->shape, *step = v->strides;
  p->data = v->data;
  p->row = p->column = 0;
  if (v->dimensions > 2) return 0;
  if (v->bytes == v->item && (count == 1 || (one_for_all && count > 0))) return 1;
  if (v->bytes == 0 || count == 0) return v->bytes == 0 && count == 0 && v->dimensions > 0;
  if (v->dimensions == 0) return 0;
  if (v->dimensions == 1) {
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
  const size item = sizeof(double);
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

static sort sort_of(object *x) {
  object *type = py.type(x);
  py.decrease(type); /* it lives as long as x */
  if (type == py.array_type) return ARRAY;
  if (type == py.float_type) return NUMBER;
  if (type == py.list_type) return LIST;
  if (py.subtype(type, py.float_type) || py.subtype(type, py.int_type)) return NUMBER;
  if (py.subtype(type, py.tuple_type)) return TUPLE;
  if (py.subtype(type, py.list_type)) return LIST;
  if (!py.check_buffer(x) || py.subtype(type, py.masked_type)) return OTHER;
  return py.subtype(type, py.bytes_type) ? OTHER : ARRAY;
}

static int opened(object *x, view *v, int flags) {
  if (py.get_buffer(x, v, STRIDES | FORMAT | flags) == 0) return 1;
  py.clear_error();
  return 0;
}

static int number(object *x, sort of, double *to) {
  if (of != NUMBER) return 0;
  *to = py.as_double(x);
  if (*to != -1.0 || !py.error()) return 1;
  py.clear_error(); /* an integer that no double holds */
  return 0;
}

/* The numbers in an array, matched to a shape, gathered. */
static int numbers(object *x, const shape *s, int one_for_all, double *to) {
  view v;
  place p;
  if (!opened(x, &v, 0)) return 0;
  const int done = understood(&v, &p) && placed(&v, s, one_for_all, &p);
  if (done) gather(&p, s, to);
  py.release_buffer(&v);
  return done;
}

static size length(object *x, sort of) {
  return of == LIST ? py.list_size(x) : py.tuple_size(x);
}

static object *item(object *x, sort of, size k) {
  return of == LIST ? py.list_item(x, k) : py.tuple_item(x, k);
}

/* What to answer of a list that the buffer of one of its items has made shorter. */
static int shrunk(void) {
  py.clear_error();
  return 0;
}

/* A list of numbers, of doubles at a distance in `to`. */
static int flat(object *x, sort of, size count, size step, double *to) {
  const shape one = {1, 1, 1, NULL};
  if (length(x, of) != count) return 0;
  for (size k = 0; k < count; ++k) {
    object *each = item(x, of, k);
    if (!each) return shrunk();
    const sort what = sort_of(each);
    if (!number(each, what, to + k * step) &&
        !(what == ARRAY && numbers(each, &one, 0, to + k * step)))
      return 0;
  }
  return 1;
}

/* A list of numbers, or of rows that are lists or arrays, as a dense matrix. */
static int nested(object *x, sort of, const shape *s, double *to, double *row) {
  const int line = s->rows == 1 || s->columns == 1;
  const size given = length(x, of), count = (size)(s->rows * s->columns);
  if (s->indices) return 0;
  if (given == 0) return count == 0;
  const sort first = sort_of(item(x, of, 0));
  if (line && given == count && first == NUMBER) return flat(x, of, count, 1, to);
  if (line && given == count && flat(x, of, count, 1, to)) return 1;
  const int turned = given != (size)s->rows;
  if (turned && !(line && given == (size)s->columns)) return 0;
  const size width = (size)(turned ? s->rows : s->columns);
  const size step = turned ? 1 : (size)s->rows, next = turned ? (size)s->rows : 1;
  const shape of_row = {1, width, width, NULL};
  for (size k = 0; k < given; ++k) {
    object *each = item(x, of, k);
    if (!each) return shrunk();
    const sort what = sort_of(each);
    if (what == LIST || what == TUPLE) {
      if (!flat(each, what, width, step, to + k * next)) return 0;
      continue;
    }
    if (what != ARRAY || !numbers(each, &of_row, 0, row)) return 0;
    for (size c = 0; c < width; ++c) to[k * next + c * step] = row[c];
  }
  return 1;
}

/* One input: where the code finds its numbers, or NULL. `room` is for what must be gathered. */
static const double *input(const function *f, call *c, object *x, const shape *s, double *room) {
  const sort what = sort_of(x);
  if (what == ARRAY) {
    view *v = &c->in[c->opened];
    place p;
    if (!opened(x, v, 0)) return NULL;
    if (!understood(v, &p) || !placed(v, s, !f->finite, &p)) {
      py.release_buffer(v);
      return NULL;
    }
    if (s->stored && in_place(&p, s)) {
      ++c->opened;
      return v->data;
    }
    gather(&p, s, room);
    py.release_buffer(v);
    return room;
  }
  if (what == LIST || what == TUPLE) {
    double *row = room + s->stored;
    return nested(x, what, s, room, row) ? room : NULL;
  }
  double value;
  const long long count = s->rows * s->columns;
  if (count == 0 || !number(x, what, &value)) return NULL;
  if (count != 1 && f->finite && value != 0) return NULL; /* a model takes zero for all alone */
  for (long long k = 0; k < s->stored; ++k) room[k] = value;
  return room;
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

/* One output in an array: where the code writes its numbers, or NULL. */
static double *output(call *c, object *array, const shape *s, double *room) {
  view *v = &c->out[c->made];
  place *p = &c->to[c->made];
  if (!opened(array, v, WRITABLE)) return NULL;
  if (!understood(v, p) || p->kind != 'f' || p->item != 8 || p->swapped || !placed(v, s, 0, p)) {
    py.release_buffer(v);
    return NULL;
  }
  int direct = in_place(p, s);
  for (int i = 0; direct && i < c->opened; ++i) direct = apart(v, &c->in[i]);
  for (int i = 0; direct && i < c->made; ++i) direct = apart(v, &c->out[i]);
  py.increase(array);
  c->arrays[c->made++] = array;
  return direct ? v->data : room;
}

/* Whether the inputs are taken; in the room of outputs that are not yet written. */
static int taken(const function *f, const double *const *arguments, double *space,
                 long long *integers) {
  const function *g = f->guard ? py.capsule_pointer(f->guard, LABEL) : NULL;
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
static int run(const function *f, call *c, object *const *given, int brought, double *space,
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
    object *array = brought ? given[f->inputs + k] : py.call(f->empty, f->new_[k]);
    if (!array) {
      py.clear_error();
      return 0;
    }
    results[k] = output(c, array, &f->out[k], room);
    if (!brought) py.decrease(array);
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
    if (written[k] != c->out[k].data) scatter(written[k], s, &c->to[k]);
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
  const function *g = f->guard ? py.capsule_pointer(f->guard, LABEL) : NULL;
  return count + widest /* a row of a list */ + (g ? g->arguments + g->results + g->reals : 0);
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
  double reals[STACK];
  long long integers[64];
  const int brought = count == f->inputs + f->outputs;
  double *w = f->space <= STACK ? reals : malloc((size_t)f->space * sizeof(double));
  long long *iw = f->integers <= 64 ? integers : malloc((size_t)f->integers * sizeof(long long));
  const int done =
      w && iw && (brought || count == f->inputs) && run(f, &c, given, brought, w, iw);
  if (w != reals) free(w);
  if (iw != integers) free(iw);
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
  if (f->guard) py.decrease(f->guard);
  for (int k = 0; k < f->outputs; ++k) {
    py.decrease(f->new_[k]);
    free((void *)f->out[k].indices);
  }
  for (int k = 0; k < f->inputs; ++k) free((void *)f->in[k].indices);
  free(f);
}

/* A copy of its own of the indices of a sparse matrix; 0 without memory. */
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
  if (f->guard) {
    const function *g = py.capsule_pointer(f->guard, LABEL);
    py.increase(f->guard);
    if (g && g->integers > f->integers) f->integers = g->integers;
  }
  for (int k = 0; k < f->outputs; ++k) {
    py.increase(f->new_[k]);
    complete = own_indices(&f->out[k]) && complete;
  }
  for (int k = 0; k < f->inputs; ++k) complete = own_indices(&f->in[k]) && complete;
  f->space = space_of(f);
  object *capsule = complete ? py.new_capsule(f, LABEL, forget) : NULL;
  if (!capsule) return NULL;
  object *builtin = py.new_function(&description, capsule, NULL);
  py.decrease(capsule);
  return builtin;
}
