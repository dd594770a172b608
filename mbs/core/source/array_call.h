/* A builtin that calls machine code on numpy arrays. */
#ifndef MBS_ARRAY_CALL_H
#define MBS_ARRAY_CALL_H

#include <Python.h>

/* array_call((evaluate, checkout, release), (arg, res, iw, w), (ndarray, MaskedArray, empty),
 * inputs, outputs, finite, guard, guarded): see mbs.native.array_calls. */
PyObject *array_call_new(PyObject *module, PyObject *args);

#endif
