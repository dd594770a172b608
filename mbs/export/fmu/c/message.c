#include "message.h"

#include <math.h>

#define EXACT 22       /* exponent of the largest power of ten that a double represents exactly */
#define MOST_DIGITS 15 /* number of decimal digits that a double always keeps */
#define PLAIN -4       /* smaller powers of ten are written with an exponent, as printf does */

void message_begin(message *m, char *text, size_t size) {
    m->text = text;
    m->size = size;
    m->length = 0;
    text[0] = 0;
}

/* Append a character. */
static void letter(message *m, char c) {
    if (m->length + 1 >= m->size) return;
    m->text[m->length++] = c;
    m->text[m->length] = 0;
}

void message_text(message *m, const char *text) {
    while (*text) letter(m, *text++);
}

/* Append a whole number. */
static void whole(message *m, unsigned long value) {
    char digits[3 * sizeof value];
    int n = 0;
    do digits[n++] = (char)('0' + value % 10u);
    while (value /= 10u);
    while (n) letter(m, digits[--n]);
}

/* Ten to a power of at least 0. */
static double power(int exponent) {
    double p = 1.0;
    while (exponent-- > 0) p *= 10.0;
    return p;
}

/* Return value 10^exponent, with one rounding if the power is exact. */
static double scaled(double value, int exponent) {
    for (; exponent > EXACT; exponent -= EXACT) value *= power(EXACT);
    for (; exponent < -EXACT; exponent += EXACT) value /= power(EXACT);
    return exponent < 0 ? value / power(-exponent) : value * power(exponent);
}

/* Compute the decimal digits of a positive number, rounded to `kept` digits, and its exponent.
 * Returns the number of digits without trailing zeros. */
static int digits_of(double value, int kept, char *digits, int *exponent) {
    double size = value, rounded;
    int k, count = kept;
    for (*exponent = 0; size >= 10.0; size /= 10.0) ++*exponent;
    for (; size < 1.0; size *= 10.0) --*exponent;
    rounded = rint(scaled(value, kept - 1 - *exponent));
    if (rounded < power(kept - 1)) rounded = rint(scaled(value, kept - 1 - --*exponent));
    if (rounded >= power(kept)) rounded = rint(scaled(value, kept - 1 - ++*exponent));
    for (k = kept; k-- > 0; rounded = floor(rounded / 10.0))
        digits[k] = (char)('0' + (int)(rounded - 10.0 * floor(rounded / 10.0)));
    while (count > 1 && digits[count - 1] == '0') count--;
    return count;
}

void message_number(message *m, double value, int digits) {
    char found[MOST_DIGITS];
    int k, count = 1, exponent = 0, first;
    if (isnan(value)) {
        message_text(m, "nan");
        return;
    }
    if (signbit(value)) letter(m, '-');
    if (isinf(value)) {
        message_text(m, "inf");
        return;
    }
    if (digits > MOST_DIGITS) digits = MOST_DIGITS;
    if (digits < 1) digits = 1;
    found[0] = '0';
    value = fabs(value);
    if (value > 0.0) count = digits_of(value, digits, found, &exponent);
    first = exponent < PLAIN || exponent >= digits ? 0 : exponent; /* power of the first digit */
    if (first < 0) message_text(m, "0.");
    for (k = first + 1; k < 0; k++) letter(m, '0');
    for (k = 0; k < count || k <= first; k++) {
        if (k && k == first + 1) letter(m, '.');
        letter(m, k < count ? found[k] : '0');
    }
    if (first == exponent) return;
    letter(m, 'e');
    letter(m, exponent < 0 ? '-' : '+');
    exponent = exponent < 0 ? -exponent : exponent;
    if (exponent < 10) letter(m, '0');
    whole(m, (unsigned long)exponent);
}

/* Append one argument by the format after a percent sign. Returns the last letter of the format. */
static const char *one(message *m, const char *at, va_list *args) {
    int digits = 6, value;
    if (*at == '.')
        for (digits = 0; *++at >= '0' && *at <= '9';) digits = 10 * digits + (*at - '0');
    switch (*at) {
        case 's': message_text(m, va_arg(*args, const char *)); break;
        case 'g': message_number(m, va_arg(*args, double), digits); break;
        case 'u': whole(m, va_arg(*args, unsigned)); break;
        case 'l': whole(m, va_arg(*args, unsigned long)), at++; break;
        default:
            value = va_arg(*args, int);
            if (value < 0) letter(m, '-');
            whole(m, value < 0 ? 0ul - (unsigned long)value : (unsigned long)value);
    }
    return at;
}

void message_format(message *m, const char *format, va_list args) {
    va_list rest;
    va_copy(rest, args);
    for (; *format; format++) {
        if (*format == '%')
            format = one(m, format + 1, &rest);
        else
            letter(m, *format);
    }
    va_end(rest);
}
