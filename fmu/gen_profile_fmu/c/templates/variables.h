/* The FMU's variables; a variable's value reference is its index. */
#ifndef VARIABLES_H
#define VARIABLES_H

#include <float.h>

/* Counts, and the first value reference of every block. */
enum {
    {{ counts }},
{{ offsets }}
};

typedef enum { {{ types }} } Type;
typedef enum { {{ kinds }} } Kind;
enum { ACCELERATION_INPUT, VELOCITY_INPUT, SETPOINT_INPUT };
{{ constants }}
typedef struct {
    const char *name;
    Type type;
    Kind kind;
    double start, lower, upper, nominal;
} Variable;

static const Variable VARIABLES[N_VALUES] = {
{{ rows }}
};

#endif
