/*
 * {{ file }}.h: a planner, which plans every motion of its axes, in C99, from gen-profile.
 *
 * Made of the function block {{ block }} of {{ file }}.st; setpoints are the same, bit for bit. It allocates
 * nothing and calls nothing but fabs, sqrt and nearbyint of libm; a state takes some {{ kilobytes }} kB.
 *
 *     {{ name }}_state state;
 *     {{ name }}_inputs in;
 *     {{ name }}_outputs out;
 *     {{ name }}_init(&state, &in);
 *     {{ name }}_step(&state, &in, &out);
 *
 * the last in every cycle, after setting what changed of `in`; then {{ positions }}. Names
 * and behaviour are the block's. Its own words:
 *
{{ words }}
 */
#ifndef {{ guard }}_H
#define {{ guard }}_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
{{ inputs }}
} {{ name }}_inputs;

typedef struct {
{{ outputs }}
} {{ name }}_outputs;

{{ structures }}/* Memory of the planner: to be kept from cycle to cycle, and to be changed by its functions only. */
typedef struct {
    {{ name }}_outputs out;
{{ memory }}
} {{ name }}_state;

/* Set the state, and all inputs to their initial values. Once, before all else. */
void {{ name }}_init({{ name }}_state *state, {{ name }}_inputs *in);

/* Plan and issue the next setpoint. Once in every cycle. Returns 0, or 1 where an index would have left its array:
   then stop the axis by other means, and report it as an error of gen-profile. */
int {{ name }}_step({{ name }}_state *state, const {{ name }}_inputs *in, {{ name }}_outputs *out);

#ifdef __cplusplus
}
#endif

#endif
