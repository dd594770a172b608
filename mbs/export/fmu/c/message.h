/* Text of messages, formatted without stdio. */
#ifndef MBS_MESSAGE_H
#define MBS_MESSAGE_H

#include <stdarg.h>
#include <stddef.h>

/* Text buffer, always terminated by zero. Text that does not fit is dropped. */
typedef struct {
    char *text;
    size_t size, length;
} message;

void message_begin(message *m, char *text, size_t size);
void message_text(message *m, const char *text);

/* Append a number as %.{digits}g of printf, up to 15 digits. */
void message_number(message *m, double value, int digits);

/* Append text like vprintf, with the formats %s, %d, %u, %lu, %g and %.{digits}g only. */
void message_format(message *m, const char *format, va_list args);

#endif
