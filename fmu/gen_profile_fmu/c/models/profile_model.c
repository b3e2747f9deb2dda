/* A motion alone: no states, exact at any time. */
#include <math.h>

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

static int model_is_sound(const Model *model) { return motion_is_sound(model); }

static void model_outputs(Model *model) { motion_outputs(model); }

static int model_output_derivative(const Model *model, unsigned output, int order, double *value) {
    double position[N_A][N_POWERS];
    const int index = (int)output - COMMAND;
    if (index < 0 || index >= (int)N_COMMANDS * N_A) return 0;
    motion_from_now(model, position);
    *value = derivative_now(position[index % N_A], index / N_A + order);
    return 1;
}

static void model_derivatives(Model *model) { (void)model; }

static void model_tangent(const Model *model, double tangent[N_VALUES]) { motion_tangent(model, tangent); }

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
