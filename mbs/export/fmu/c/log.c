#include "log.h"

#include <stdarg.h>
#include <string.h>

#include "message.h"
#include "references.h"

static const char *const CATEGORIES[] = {"logAll", "logStatusDiscard", "logStatusError"};
enum { LOG_ALL, LOG_DISCARD, LOG_ERROR, N_CATEGORIES };

const char *log_category(core_status status) {
    return CATEGORIES[status == CORE_DISCARD ? LOG_DISCARD : LOG_ERROR];
}

core_status log_select(core_log *l, int on, const char *const *categories, size_t n) {
    size_t i;
    int discards = n == 0;
    for (i = 0; i < n; i++) {
        int k = 0;
        while (k < N_CATEGORIES &&
               !(categories && categories[i] && !strcmp(categories[i], CATEGORIES[k])))
            k++;
        if (k == N_CATEGORIES) return log_error(l, "log category %u is unknown", (unsigned)i);
        discards = discards || k != LOG_ERROR;
    }
    l->discards = on && discards;
    return CORE_OK;
}

/* Pass a message to the importer. Returns the status. */
static core_status say(core_log *l, core_status status, const char *format, va_list args) {
    message m;
    if (!l->write || (status == CORE_DISCARD && !l->discards)) return status;
    message_begin(&m, l->text, sizeof l->text);
    message_text(&m, l->name);
    message_text(&m, ": ");
    message_format(&m, format, args);
    l->write(l->host, l->name, status, l->text);
    return status;
}

core_status log_error(core_log *l, const char *format, ...) {
    core_status status;
    va_list args;
    va_start(args, format);
    status = say(l, CORE_ERROR, format, args);
    va_end(args);
    return status;
}

core_status log_failed(core_log *l, const char *format, ...) {
    core_status status = l->run->mode & CONTINUOUS ? CORE_DISCARD : CORE_ERROR;
    va_list args;
    va_start(args, format);
    status = say(l, status, format, args);
    va_end(args);
    return status;
}

const char *log_mode_name(int mode) {
    switch (mode) {
        case INSTANTIATED: return "before initialization";
        case INITIALIZATION: return "in initialization mode";
        case EVENT: return "in event mode";
        case CONTINUOUS: return "in continuous-time mode";
        case STEP: return "between steps";
        case INTERMEDIATE: return "during an intermediate update";
        default: return "after termination";
    }
}

int log_allowed(core_log *l, int modes, const char *action) {
    if (l->run->mode & modes) return 1;
    log_error(l, "%s is not possible %s", action, log_mode_name(l->run->mode));
    return 0;
}

const char *log_where(core_log *l) {
    message m;
    int i;
    message_begin(&m, l->where, sizeof l->where);
    for (i = 0; i < NX; i++) {
        message_text(&m, i ? ", " : "");
        message_text(&m, MODEL_NAMES[STATES + i]);
        message_text(&m, " = ");
        message_number(&m, l->states[i], 6);
    }
    return l->where;
}
