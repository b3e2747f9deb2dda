/* Compile without contraction of products and sums (-ffp-contract=off). */
#include "{{ name }}.h"
#include <math.h>
#include <string.h>

#ifdef COUNT_OPERATIONS
long {{ name }}_operations;
#define OPERATIONS(number) ({{ name }}_operations += (number))
#else
#define OPERATIONS(number) ((void)0)
#endif
#ifdef __GNUC__
#define APART __attribute__((noinline))
#define RARE(condition) __builtin_expect(condition, 0)
#else
#define APART
#define RARE(condition) (condition)
#endif
#ifdef CHECKED
/* A fault is a branch that is predicted not to be taken: to select a value in each operation takes twice the time. */
#define BEGIN() int32_t turns_ = fb->turns_, fault_ = fb->fault_
#define FIRST() (turns_ = 0)
#define CALL(name, instance) ((instance).turns_ = turns_, (instance).fault_ = fault_, name(&(instance)), \
    turns_ = (instance).turns_, fault_ = (instance).fault_)
#define PART(name) (END(), name(fb), turns_ = fb->turns_, fault_ = fb->fault_)
#define END() (fb->turns_ = turns_, fb->fault_ = fault_)
#define AT(index, length) within(&fault_, index, length)
#define TURN() turn(&fault_, &turns_)
#ifdef __GNUC__ /* by the processor's overflow flag */
#define SUM(one, other) whole_sum(&fault_, one, other)
#define DIFFERENCE(one, other) whole_difference(&fault_, one, other)
#define PRODUCT(one, other) whole_product(&fault_, one, other)
#else
#define SUM(one, other) whole(&fault_, (int64_t)(one) + (other))
#define DIFFERENCE(one, other) whole(&fault_, (int64_t)(one) - (other))
#define PRODUCT(one, other) whole(&fault_, (int64_t)(one) * (other))
#endif
#define QUOTIENT(one, other) whole(&fault_, (int64_t)(one) / (int64_t)nonzero(&fault_, other))
#define RATIO(one, other) ((one) / nonzero(&fault_, other))
#define ROUNDED(value) rounded(&fault_, value)
#define ROOT(value) root(&fault_, value)
#define BOTH(one, other) ((one) & (other))
#define EITHER(one, other) ((one) | (other))
static inline bool sound(int32_t *fault, bool holds, int32_t kind)
{
    if (RARE(!holds)) *fault = *fault ? *fault : kind;
    return holds;
}
static inline int32_t within(int32_t *fault, int32_t index, int32_t length)
{
    return sound(fault, (uint32_t)index < (uint32_t)length, 1) ? index : 0;
}
static inline bool turn(int32_t *fault, int32_t *turns)
{
    return sound(fault, ++*turns <= {{ most_turns }}, 2) & (*fault == 0);
}
static inline double nonzero(int32_t *fault, double divisor)
{
    return sound(fault, divisor != 0.0, 3) ? divisor : 1.0;
}
static inline int32_t whole(int32_t *fault, int64_t value)
{
    return sound(fault, value == (int32_t)value, 4) ? (int32_t)value : 0;
}
#ifdef __GNUC__
#define WHOLE(name, overflows) \
static inline int32_t name(int32_t *fault, int32_t one, int32_t other) \
{ \
    int32_t value; \
    return sound(fault, !overflows(one, other, &value), 4) ? value : 0; \
}
WHOLE(whole_sum, __builtin_add_overflow)
WHOLE(whole_difference, __builtin_sub_overflow)
WHOLE(whole_product, __builtin_mul_overflow)
#endif
static inline int32_t rounded(int32_t *fault, double value)
{
    const double found = nearbyint(value);
    return sound(fault, (found >= -2147483648.0) & (found <= 2147483647.0), 4) ? (int32_t)found : 0;
}
static inline double root(int32_t *fault, double value)
{
    return sqrt(sound(fault, !(value < 0.0), 5) ? value : 0.0);
}
#else
#define BEGIN() ((void)0)
#define FIRST() ((void)0)
#define CALL(name, instance) name(&(instance))
#define PART(name) name(fb)
#define END() ((void)0)
#define AT(index, length) (index)
#define TURN() true
#define SUM(one, other) ((one) + (other))
#define DIFFERENCE(one, other) ((one) - (other))
#define PRODUCT(one, other) ((one) * (other))
#define QUOTIENT(one, other) ((one) / (other))
#define RATIO(one, other) ((one) / (other))
#define ROUNDED(value) ((int32_t)nearbyint(value))
#define ROOT(value) sqrt(value)
#define BOTH(one, other) ((one) && (other))
#define EITHER(one, other) ((one) || (other))
#endif

{{ blocks }}{{ constants }}

static void {{ name }}_init({{ name }} *fb) {
    memset(fb, 0, sizeof *fb);
{{ initials }}
}

{{ parts }}
static void {{ name }}_step({{ name }} *fb) {
    BEGIN();
    FIRST();
{{ body }}
    END();
}
