/* Solver of co-simulation that model.h selects: headers and size of its work memory. */
#ifndef MBS_SOLVER_H
#define MBS_SOLVER_H

#include "model.h"
#include "stepper.h"

#ifdef MODEL_TREE
#include "dopri5.h"
#include "passage.h"
#include "passage_external.h"
#include "passage_start.h"
#endif

#if defined MODEL_RODAS
#include "rodas.h"
#define SOLVER_WORK RODAS_WORK
#elif defined MODEL_FIXED_STEP
#include "rk4.h"
#define SOLVER_WORK RK4_WORK
#else
#include "dopri5.h"
#define SOLVER_WORK DOPRI5_WORK
#endif

#endif
