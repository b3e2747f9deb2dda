/* The planner block, and its inputs and outputs among the FMU's variables. */
#include "{{ block }}.c"

static void block_begin(PlannerBlock *block, const double values[]) {
    {{ block }}_init(block);
{{ stands }}
}

static void block_begin_tangent(double tangent[]) {
{{ changes }}
}

static void block_call(PlannerBlock *block, const double values[]) {
{{ given }}
    {{ block }}_step(block);
}

static void block_show(const PlannerBlock *block, double values[]) {
{{ shown }}
}
