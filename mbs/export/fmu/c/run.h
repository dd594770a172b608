/* State of an instance in the state machine of the FMI standard, and its time. */
#ifndef MBS_RUN_H
#define MBS_RUN_H

/* Status of FMI functions. Discard: the importer may repeat the call with a shorter step. */
typedef enum { CORE_OK, CORE_DISCARD, CORE_ERROR } core_status;

/* States of the state machine, as bits of a set. */
typedef enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    EVENT = 4,      /* event mode */
    CONTINUOUS = 8, /* continuous-time mode of model exchange */
    STEP = 16,      /* step mode of co-simulation */
    TERMINATED = 32,
    INTERMEDIATE = 64 /* intermediate update within a communication step: values can be read */
} core_mode;

#define STARTING (INSTANTIATED | INITIALIZATION)
#define RUNNING (EVENT | CONTINUOUS | STEP)
#define READABLE (INITIALIZATION | RUNNING | INTERMEDIATE | TERMINATED)

typedef struct {
    int mode;         /* a core_mode */
    int cosimulation; /* 1 for co-simulation, 0 for model exchange */
    double time;      /* [s] */
    double stop;      /* end of the experiment [s], HUGE_VAL if it has none */
} core_run;

/* Largest difference of times that count as equal, relative to the larger of the time and 1 s.
 * Importers sum step sizes, and each sum adds a rounding error of about 1e-16. */
#define SAME_TIME 1e-9

#endif
