/*
 * Many co-simulations of one instance, by its own functions of FMI 2 or 3: no interpreter within a run.
 * For each run: reset, set the parameters, initialise, step through the inputs, keep the outputs' peaks.
 */
#include <math.h>
#include <stddef.h>

#include "fmi2FunctionTypes.h"
#include "fmi3FunctionTypes.h"

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { GOOD = 0 };

/* Functions of one version; those of the other stay null. */
typedef struct {
    fmi2ResetTYPE *reset2;
    fmi2SetupExperimentTYPE *setup2;
    fmi2EnterInitializationModeTYPE *enter2;
    fmi2ExitInitializationModeTYPE *exit2;
    fmi2SetRealTYPE *set2;
    fmi2GetRealTYPE *get2;
    fmi2DoStepTYPE *step2;
    fmi3ResetTYPE *reset3;
    fmi3EnterInitializationModeTYPE *enter3;
    fmi3ExitInitializationModeTYPE *exit3;
    fmi3SetFloat64TYPE *set3;
    fmi3GetFloat64TYPE *get3;
    fmi3DoStepTYPE *step3;
    void *instance;
} Fmu;

typedef struct {
    size_t runs, steps, inputs, parameters, outputs;
    const double *times;                 /* steps + 1 */
    const double *input_values;          /* steps x inputs */
    const double *parameter_values;      /* runs x parameters */
    const unsigned *input_references, *parameter_references, *output_references;
    size_t first;                        /* communication point from which peaks count */
} Plan;

static int set(const Fmu *fmu, const unsigned *references, size_t n, const double *values) {
    if (n == 0) return GOOD;
    return fmu->set2 ? (int)fmu->set2(fmu->instance, references, n, values)
                     : (int)fmu->set3(fmu->instance, references, n, values, n);
}

static int get(const Fmu *fmu, const unsigned *references, size_t n, double *values) {
    return fmu->get2 ? (int)fmu->get2(fmu->instance, references, n, values)
                     : (int)fmu->get3(fmu->instance, references, n, values, n);
}

static int step(const Fmu *fmu, double time, double size) {
    if (fmu->step2) return (int)fmu->step2(fmu->instance, time, size, fmi2True);
    bool event, terminate, early;
    double reached;
    return (int)fmu->step3(fmu->instance, time, size, true, &event, &terminate, &early, &reached);
}

static int begin(const Fmu *fmu, const Plan *plan, size_t run) {
    const double *values = plan->parameter_values + run * plan->parameters;
    const double start = plan->times[0];
    if (fmu->reset2) {
        return fmu->reset2(fmu->instance) || fmu->setup2(fmu->instance, fmi2False, 0.0, start, fmi2False, 0.0) ||
               set(fmu, plan->parameter_references, plan->parameters, values) || fmu->enter2(fmu->instance) ||
               fmu->exit2(fmu->instance);
    }
    return fmu->reset3(fmu->instance) || set(fmu, plan->parameter_references, plan->parameters, values) ||
           fmu->enter3(fmu->instance, false, 0.0, start, false, 0.0) || fmu->exit3(fmu->instance);
}

/* Greatest magnitudes of the outputs, runs x outputs; `values` is room for the outputs. The number of good runs. */
EXPORT size_t many_runs(const Fmu *fmu, const Plan *plan, double *values, double *peaks) {
    for (size_t run = 0; run < plan->runs; run++) {
        double *peak = peaks + run * plan->outputs;
        for (size_t i = 0; i < plan->outputs; i++) peak[i] = 0.0;
        if (begin(fmu, plan, run) != GOOD) return run;
        for (size_t k = 0; k < plan->steps; k++) {
            const double *input = plan->input_values + k * plan->inputs;
            const double size = plan->times[k + 1] - plan->times[k];
            if (set(fmu, plan->input_references, plan->inputs, input) != GOOD) return run;
            if (step(fmu, plan->times[k], size) != GOOD) return run;
            if (k + 1 < plan->first) continue;
            if (get(fmu, plan->output_references, plan->outputs, values) != GOOD) return run;
            for (size_t i = 0; i < plan->outputs; i++) peak[i] = fmax(peak[i], fabs(values[i]));
        }
    }
    return plan->runs;
}
