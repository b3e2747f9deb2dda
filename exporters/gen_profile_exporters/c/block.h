#ifndef {{ name }}_H
#define {{ name }}_H

#include <stdbool.h>
#include <stdint.h>

{{ structures }}{{ structure }}
/* Once, before all else. */
static void {{ name }}_init({{ name }} *fb);

/* Once in every cycle, the inputs set; then read the outputs. */
static void {{ name }}_step({{ name }} *fb);

#endif
