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
    const double *zones;                 /* n_zones x ZONE: where bodies may not be */
    size_t n_zones;
} Plan;

/* A zone: the outputs that are a body's x, y and z; a height, 1 where bodies have to be above it and -1 where below;
   an area, from and to in x and in y; twice an area in which it may be all the same. */
enum { X, Y, Z, TOP, UP, AREA, OWN = AREA + 4, ZONE = OWN + 8 };

static const double *of_run(const PerRun *numbers, size_t run) { return numbers->values + run * numbers->size; }

/* Length of the vector that the last outputs make up. */
static double length(const Plan *plan, const double *values) {
    double squares = 0.0;
    for (size_t i = plan->n_outputs - plan->n_components; i < plan->n_outputs; i++) squares += values[i] * values[i];
    return sqrt(squares);
}

/* How far outside an area a place is, along the axis along which it is farther. */
static double outside(const double *area, double x, double y) {
    return fmax(fmax(area[0] - x, x - area[1]), fmax(area[2] - y, y - area[3]));
}

/* By how much more than it must a body is beside a zone. */
static double beside(const double *zone, const double *places) {
    const double x = places[(size_t)zone[X]], y = places[(size_t)zone[Y]];
    double most = outside(zone + AREA, x, y);
    for (size_t i = OWN; i < ZONE; i += 4) most = fmax(most, -outside(zone + i, x, y));
    return most;
}

/* What is kept of the zones: the least room to one, when that is, and the zone's number. */
enum { ROOM, TIME, NUMBER, NEAREST };

/* Room to all zones in a step, in which bodies go straight: beside a zone or clear of its height. */
static void look(const Plan *plan, double time, const double *was, const double *is, double *nearest) {
    for (size_t number = 0; number < plan->n_zones; number++) {
        const double *zone = plan->zones + number * ZONE;
        const size_t z = (size_t)zone[Z];
        const double first = beside(zone, was), last = beside(zone, is);
        const double above = zone[UP] * (was[z] - zone[TOP]), later = zone[UP] * (is[z] - zone[TOP]);
        double room = fmin(fmax(first, above), fmax(last, later));
        const double apart = first - above, after = last - later;
        if (apart * after < 0.0) room = fmin(room, first + (last - first) * apart / (apart - after));
        if (room < nearest[ROOM]) nearest[ROOM] = room, nearest[TIME] = time, nearest[NUMBER] = (double)number;
    }
}

/* What is kept of every run. */
static size_t columns(const Plan *plan) {
    return plan->n_outputs + (plan->n_components > 0) + (plan->n_zones > 0) * NEAREST;
}

/* One run; `values` has room for the outputs twice. */
static int simulate(const Fmu *fmu, const Plan *plan, size_t run, double *values, double *peaks) {
    const double *times = of_run(&plan->times, run), *input = of_run(&plan->inputs, run);
    double *is = values, *was = values + plan->n_outputs, *nearest = peaks + columns(plan) - NEAREST;
    for (size_t i = 0; i < columns(plan); i++) peaks[i] = 0.0;
    int status = begin(fmu, times[0], plan->parameter_references, plan->n_parameters, of_run(&plan->parameters, run));
    if (plan->n_zones > 0) {
        nearest[ROOM] = HUGE_VAL;
        if (status == GOOD) status = get(fmu, plan->output_references, plan->n_outputs, is);
    }
    for (size_t k = 0; k < plan->steps && status == GOOD; k++, input += plan->n_inputs) {
        status = set(fmu, plan->input_references, plan->n_inputs, input);
        if (status == GOOD) status = step(fmu, times[k], times[k + 1] - times[k]);
        const bool counts = times[k + 1] >= plan->since;
        if (status != GOOD || (!counts && plan->n_components == 0 && plan->n_zones == 0)) continue;
        double *const other = was;
        was = is, is = other;
        status = get(fmu, plan->output_references, plan->n_outputs, is);
        for (size_t i = 0; counts && i < plan->n_outputs; i++) peaks[i] = fmax(peaks[i], fabs(is[i]));
        if (plan->n_components > 0) peaks[plan->n_outputs] = fmax(peaks[plan->n_outputs], length(plan, is));
        if (plan->n_zones > 0) look(plan, times[k + 1], was, is, nearest);
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
