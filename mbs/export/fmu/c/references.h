/* Value references and sizes of a model.
 *
 * The value reference of a variable is its index in the array of all values. Variables of one kind
 * have consecutive references, in the order of the enumeration below.
 */
#ifndef MBS_REFERENCES_H
#define MBS_REFERENCES_H

#include <stdint.h>

#include "model.h"

/* First reference of each kind. */
enum {
    STATES = 0,
    DERIVATIVES = STATES + NX,
    INPUTS = DERIVATIVES + NX,
    OUTPUTS = INPUTS + NU,
    PARAMETERS = OUTPUTS + NY,
    MODES = PARAMETERS + NP,
    DEPENDENTS = MODES + NM,
    INDICATORS = DEPENDENTS + NZ,
    CHART_STATES = INDICATORS + NK,     /* continuous states of model exchange, see charts.h */
    CHART_RATES = CHART_STATES + NS,    /* derivatives of these states */
    CHART_INDICATOR = CHART_RATES + NS, /* event indicator of a change of their coordinates */
    CUTS = CHART_INDICATOR + NC,        /* positions of cut joints */
    N_VALUES = CUTS + NCUT,
    TIME_REFERENCE = N_VALUES /* the independent variable time, a variable in FMI 3.0 only */
};

/* First references of the continuous states of model exchange and of their derivatives. */
#if MODEL_TREE_OUTSIDE
enum { CONTINUOUS_STATES = CHART_STATES, CONTINUOUS_DERIVATIVES = CHART_RATES };
#else
enum { CONTINUOUS_STATES = STATES, CONTINUOUS_DERIVATIVES = DERIVATIVES };
#endif

/* Number of integrated coordinates: those of all joints of the tree if the model has closed loops
 * with tree equations, else the states. */
#ifdef MODEL_TREE
#define NT MODEL_TREE
#else
#define NT NX
#endif
#define LARGER(a, b) ((a) > (b) ? (a) : (b))
#define N_INTEGRATED LARGER(NX, NT) /* size of arrays for states or coordinates of the tree */

/* Types of value references and integers: FMI 3.0 if adjoint derivatives exist, else FMI 2.0. */
#ifdef MODEL_ADJOINT
typedef uint32_t core_reference;
typedef int32_t core_integer;
#else
typedef unsigned core_reference;
typedef int core_integer;
#endif

#endif
