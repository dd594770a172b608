/* Stubs of the derivatives of a compiled Function. At its first call a stub lets Python compile the
 * derivative, which writes its addresses to a table. This text is preceded by definitions of COUNT
 * (number of stubs), PARTS (number of derivatives) and RECORD (path of the file with the Function).
 * It is followed by a line FORWARD or FORWARD_VOID for each stub.
 *
 * The stubs also work in another process to which the Function is sent, without registration: the
 * few functions of the stable interface of Python are looked up in the process. */
#include <stdint.h>
#include <stdio.h>
#ifdef _WIN32
#include <windows.h>
#define EXPORT __declspec(dllexport)
static void *of_python(const char *name) {
    return (void *)(intptr_t)GetProcAddress(LoadLibraryA("python3.dll"), name);
}
#else
#include <dlfcn.h>
#define EXPORT __attribute__((visibility("default")))
static void *of_python(const char *name) {
    void *process = dlopen(NULL, RTLD_LAZY);
    return process ? dlsym(process, name) : NULL;
}
#endif

typedef long long int ll;
typedef struct object object;

static void *found[COUNT];
static int known[PARTS];

#define USE(type, name, arguments) type(*const name) arguments = (type(*) arguments)of_python(#name)

static int fetched(int part) {
    if (known[part]) return 1;
    USE(int, Py_IsInitialized, (void));
    USE(int, PyGILState_Ensure, (void));
    USE(void, PyGILState_Release, (int));
    USE(object *, PyImport_ImportModule, (const char *));
    USE(object *, PyObject_CallMethod, (object *, const char *, const char *, ...));
    USE(void, PyErr_Print, (void));
    USE(void, Py_DecRef, (object *));
    if (!Py_IsInitialized || !PyGILState_Ensure || !PyGILState_Release || !PyImport_ImportModule ||
        !PyObject_CallMethod || !PyErr_Print || !Py_DecRef || !Py_IsInitialized()) {
        fprintf(stderr, "derivatives of %s are made by Python, which does not run here\n", RECORD);
        return 0;
    }
    const int held = PyGILState_Ensure();
    object *module = PyImport_ImportModule("mbs.native._compiled");
    object *answer = module ? PyObject_CallMethod(module, "fetch_derivatives", "siL", RECORD, part,
                                                  (ll)(intptr_t)found)
                            : NULL;
    if (!answer) PyErr_Print();
    known[part] = answer != NULL;
    Py_DecRef(answer);
    Py_DecRef(module);
    PyGILState_Release(held);
    return known[part];
}

/* Readiness of a part for stubs that are called last: they do not start a compilation. */
static int there(int part) { return known[part]; }

#define FORWARD(name, k, part, ready, otherwise, type, declared, passed)             \
    EXPORT type name declared {                                                      \
        type(*const code) declared = (type(*) declared)(ready(part) ? found[k] : 0); \
        return code ? code passed : otherwise;                                       \
    }
#define FORWARD_VOID(name, k, part, ready, declared, passed)                         \
    EXPORT void name declared {                                                      \
        void(*const code) declared = (void(*) declared)(ready(part) ? found[k] : 0); \
        if (code) code passed;                                                       \
    }
