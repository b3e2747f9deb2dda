/*
 * A co-simulation that goes on from where the instance is, and keeps its outputs before the first and after
 * every step: no interpreter within.
 */
#include "called_fmu.h"

typedef struct {
    size_t steps, n_inputs, n_outputs;
    const double *times, *sizes;         /* of each step: where it begins, how long it is */
    const double *inputs;                /* steps x n_inputs, set before each step */
    const unsigned *input_references, *output_references;
} Steps;

/* `samples`: (steps + 1) x n_outputs. How many rows were filled: fewer where the FMU refuses to go on. */
EXPORT size_t sampled_run(const Fmu *fmu, const Steps *steps, double *samples) {
    const double *input = steps->inputs;
    size_t row = 0;
    int status = get(fmu, steps->output_references, steps->n_outputs, samples);
    while (status == GOOD && row < steps->steps) {
        status = set(fmu, steps->input_references, steps->n_inputs, input + row * steps->n_inputs);
        if (status == GOOD) status = step(fmu, steps->times[row], steps->sizes[row]);
        row++;
        samples += steps->n_outputs;
        if (status == GOOD) status = get(fmu, steps->output_references, steps->n_outputs, samples);
    }
    return status == GOOD ? row + 1 : row;
}
