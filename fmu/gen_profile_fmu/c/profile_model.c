/* A motion alone: no states, exact at any time. */
#include <math.h>
#include <string.h>

#include "motion.h"

static void model_start(Model *model) {
    model->began = HUGE_VAL;
    model->segment = -1;
    motion_pass_knots(model);
}

static int model_event(Model *model) {
    motion_pass_knots(model);
    return 0;
}

static void model_outputs(Model *model) { motion_outputs(model); }

static void model_derivatives(Model *model) { (void)model; }

static void model_tangent(const Model *model, double tangent[N_VALUES]) {
    (void)model; /* nothing that may be changed on the way has an influence */
    memset(tangent + COMMAND, 0, 4 * N_A * sizeof *tangent);
}

static void model_start_tangent(double tangent[N_VALUES]) { (void)tangent; }

static double model_substeps(const Model *model, double step) {
    (void)model, (void)step;
    return 1.0;
}

static void model_advance(Model *model, double step) {
    motion_pass_knots(model); /* for a trigger that was set at the step's beginning */
    model->time += step;
    motion_pass_knots(model);
}
