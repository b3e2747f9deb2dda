/*
 * Many co-simulations of one instance, by its own functions: no interpreter within a run.
 * For each run: reset, set the parameters, initialise, step through the inputs, keep the outputs' peaks.
 */
#include <math.h>

#include "called_fmu.h"

/* Numbers of every run, one run behind the other; those that all runs share are there once, and `size` is 0. */
typedef struct {
    const double *values;
    size_t size;
} PerRun;

typedef struct {
    PerRun times;                        /* steps + 1 */
    PerRun inputs;                       /* steps x n_inputs */
    PerRun parameters;                   /* n_parameters */
    size_t steps, n_inputs, n_parameters, n_outputs;
    const unsigned *input_references, *parameter_references, *output_references;
    size_t n_components;                 /* of the last outputs: of a vector whose greatest length is kept, too */
    double since;                        /* time from which peaks of single outputs count */
} Plan;

static const double *of_run(const PerRun *numbers, size_t run) { return numbers->values + run * numbers->size; }

/* Length of the vector that the last outputs make up. */
static double length(const Plan *plan, const double *values) {
    double squares = 0.0;
    for (size_t i = plan->n_outputs - plan->n_components; i < plan->n_outputs; i++) squares += values[i] * values[i];
    return sqrt(squares);
}

/* What is kept of every run. */
static size_t columns(const Plan *plan) { return plan->n_outputs + (plan->n_components > 0); }

/* One run; `values` is room for the outputs. */
static int simulate(const Fmu *fmu, const Plan *plan, size_t run, double *values, double *peaks) {
    const double *times = of_run(&plan->times, run), *input = of_run(&plan->inputs, run);
    for (size_t i = 0; i < columns(plan); i++) peaks[i] = 0.0;
    int status = begin(fmu, times[0], plan->parameter_references, plan->n_parameters, of_run(&plan->parameters, run));
    for (size_t k = 0; k < plan->steps && status == GOOD; k++, input += plan->n_inputs) {
        status = set(fmu, plan->input_references, plan->n_inputs, input);
        if (status == GOOD) status = step(fmu, times[k], times[k + 1] - times[k]);
        const bool counts = times[k + 1] >= plan->since;
        if (status != GOOD || (!counts && plan->n_components == 0)) continue;
        status = get(fmu, plan->output_references, plan->n_outputs, values);
        for (size_t i = 0; counts && i < plan->n_outputs; i++) peaks[i] = fmax(peaks[i], fabs(values[i]));
        if (plan->n_components > 0) peaks[plan->n_outputs] = fmax(peaks[plan->n_outputs], length(plan, values));
    }
    return status;
}

/* Greatest magnitudes of the outputs in runs [first, end), runs x columns. The first bad run, or `end`. */
EXPORT size_t many_runs(const Fmu *fmu, const Plan *plan, size_t first, size_t end, double *values, double *peaks) {
    for (size_t run = first; run < end; run++) {
        if (simulate(fmu, plan, run, values, peaks + run * columns(plan)) != GOOD) return run;
    }
    return end;
}
