/* Texts of messages, put together without stdio. */
#ifndef MBS_MESSAGE_H
#define MBS_MESSAGE_H

#include <stdarg.h>
#include <stddef.h>

/* A text that grows; it ends with a zero always, and what does not fit is left out. */
typedef struct {
    char *text;
    size_t size, length;
} message;

void message_begin(message *m, char *text, size_t size);
void message_text(message *m, const char *text);

/* As %.{digits}g of printf, up to 15 digits. */
void message_number(message *m, double value, int digits);

/* As vprintf, of %s, %d, %u, %lu, %g and %.{digits}g alone. */
void message_format(message *m, const char *format, va_list args);

#endif
