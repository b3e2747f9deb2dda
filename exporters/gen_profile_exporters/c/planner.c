/* $file.c: see $file.h. Compile as C99 (-std=c99), without -ffast-math. */
#include "$file.h"

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

$constants

void ${name}_init(${name}_state *state, ${name}_inputs *in)
{
    memset(state, 0, sizeof *state);
    memset(in, 0, sizeof *in);
$initials
}

void ${name}_step(${name}_state *state, const ${name}_inputs *in, ${name}_outputs *out)
{
$body
    *out = state->out;
}
