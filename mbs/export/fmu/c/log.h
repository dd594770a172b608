/* Error messages of an instance, for the logger of the importer.
 *
 * Every message begins with the name of the instance. Formats are those of message.h.
 */
#ifndef MBS_LOG_H
#define MBS_LOG_H

#include <stddef.h>

#include "run.h"

#define LOG_TEXT 1024 /* longest message, longest list of state values */
#define LOG_WHERE 512

typedef void (*core_logger)(void *host, const char *name, core_status status, const char *message);

typedef struct {
    const char *name;  /* of the instance */
    core_logger write; /* or NULL */
    void *host;        /* first argument of `write` */
    int discards;      /* 1 to log discarded calls too; errors are always logged */
    const core_run *run;
    const double *states;                  /* (NX,) values of the states, for messages */
    char text[LOG_TEXT], where[LOG_WHERE]; /* last message, last list of state values */
} core_log;

/* Log an error. Returns CORE_ERROR. */
core_status log_error(core_log *l, const char *format, ...);

/* Log that an evaluation has failed. Returns CORE_DISCARD in continuous-time mode, else CORE_ERROR.
 * An external integrator may try a shorter step. A co-simulation master can only return to a saved
 * state, and some masters repeat a discarded step forever: it gets an error. */
core_status log_failed(core_log *l, const char *format, ...);

/* Return 1 if the instance is in one of the modes, otherwise 0 after an error message. */
int log_allowed(core_log *l, int modes, const char *action);

/* Names and values of the states as text, until the next call. */
const char *log_where(core_log *l);

/* Words for a core_mode, such as "in event mode". */
const char *log_mode_name(int mode);

/* Log category of FMI for a status. */
const char *log_category(core_status status);

/* Select the categories to log. on: 0 to log errors only; n: number of categories, 0 for all. */
core_status log_select(core_log *l, int on, const char *const *categories, size_t n);

#endif
