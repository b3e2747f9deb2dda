/* {{ file }}.c: see {{ file }}.h. Compile as C99 (-std=c99), without -ffast-math. */
#include "{{ file }}.h"

#include <math.h>
#include <string.h>

#ifdef __FAST_MATH__
#error "-ffast-math: inputs that are no numbers could not be distinguished from others."
#endif
/* A product and a sum in one rounding would give other bits; GCC keeps to -std=c99 by itself. */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

/* Beyond its array an index counts as 0, and the step returns 1: nothing else in memory is read or written. */
static inline int32_t within(int *left, int32_t index, int32_t length)
{
    const int beyond = (uint32_t)index >= (uint32_t)length;
    *left |= beyond;
    return beyond ? 0 : index;
}
#define AT(index, length) within(&left, index, length)
#define CALL(name, instance) (left |= name(&(instance)))

{{ blocks }}{{ constants }}

void {{ name }}_init({{ name }}_state *state, {{ name }}_inputs *in)
{
    memset(state, 0, sizeof *state);
    memset(in, 0, sizeof *in);
{{ initials }}
}

int {{ name }}_step({{ name }}_state *state, const {{ name }}_inputs *in, {{ name }}_outputs *out)
{
    int left = 0;
{{ body }}
    *out = state->out;
    return left;
}
