/* Messages without stdio, which real-time targets lack. */
#include <math.h>
#include <stdarg.h>
#include <string.h>

enum { MESSAGE_SIZE = 512, DIGITS = 12 };

typedef struct {
    char text[MESSAGE_SIZE];
    size_t length;
} Message;

static void append(Message *message, const char *text) {
    while (*text && message->length < MESSAGE_SIZE - 1) message->text[message->length++] = *text++;
    message->text[message->length] = '\0';
}

static void append_whole(Message *message, unsigned long value) {
    char text[24];
    char *first = text + sizeof text - 1;
    *first = '\0';
    do *--first = (char)('0' + value % 10);
    while (value /= 10);
    append(message, first);
}

/* The first digits of a number, without zeros at the end, as 12.5 or 1.25e-07. */
static void append_number(Message *message, double value) {
    if (value != value) append(message, "nan");
    else if (value < 0.0) append(message, "-");
    value = fabs(value);
    if (!isfinite(value)) {
        append(message, value > 0.0 ? "inf" : "");
        return;
    }
    int exponent = value > 0.0 ? (int)floor(log10(value)) : 0;
    double scaled = value > 0.0 ? floor(value / pow(10.0, exponent) * pow(10.0, DIGITS - 1) + 0.5) : 0.0;
    if (scaled >= pow(10.0, DIGITS)) {
        scaled /= 10.0;
        exponent++;
    }
    char digits[DIGITS + 1];
    for (int i = DIGITS - 1; i >= 0; i--) {
        digits[i] = (char)('0' + (int)fmod(scaled, 10.0));
        scaled = floor(scaled / 10.0);
    }
    int count = DIGITS;
    while (count > 1 && digits[count - 1] == '0') count--;
    const int plain = exponent >= -4 && exponent < (count > 6 ? count : 6);
    int point = plain ? exponent : 0; /* the place after which the decimal point stands */
    for (int i = point < 0 ? point : 0; i < count || i <= point; i++) {
        char next[3] = {i >= 0 && i < count ? digits[i] : '0', '\0', '\0'};
        if (i == point + 1) append(message, ".");
        append(message, next);
    }
    if (!plain) {
        append(message, exponent < 0 ? "e-" : "e+");
        if (exponent > -10 && exponent < 10) append(message, "0");
        append_whole(message, (unsigned long)(exponent < 0 ? -exponent : exponent));
    }
}

/* Write a text with %s, %g and %u. */
static void compose(Message *message, const char *format, va_list arguments) {
    message->length = 0;
    message->text[0] = '\0';
    for (; *format; format++) {
        const char plain[2] = {*format, '\0'};
        if (*format != '%') {
            append(message, plain);
            continue;
        }
        switch (*++format) {
            case 's': append(message, va_arg(arguments, const char *)); break;
            case 'g': append_number(message, va_arg(arguments, double)); break;
            default: append_whole(message, va_arg(arguments, unsigned)); break;
        }
    }
}
