/*
 * A planner block, called once in every cycle of its task: a sampled controller without continuous states.
 *
 * In co-simulation the cycles that begin within a step are called with the inputs of the step's beginning, and the
 * outputs are known at its end. In model exchange each cycle is a time event.
 */
#include <math.h>

#include "model.h"

static const double EARLY = 1e-6;  /* of a cycle: masters add up their steps, and a cycle is the next step's then */

static void model_start(Model *model) {
    block_begin(&model->block, model->values);
    model->samples = 0;
    model->next_event = model->start_time;
}

static void call(Model *model) {
    block_call(&model->block, model->values);
    model->samples++;
    model->next_event = model->start_time + model->samples * CYCLE;
}

static int model_event(Model *model) {
    if (is_come(model, model->next_event)) call(model);
    return 0;
}

static int model_is_sound(const Model *model) { return model->samples >= 0; }

static void model_outputs(Model *model) { block_show(&model->block, model->values); }

static void model_derivatives(Model *model) { (void)model; }

static void model_tangent(const Model *model, double tangent[N_VALUES]) { (void)model, (void)tangent; }

static void model_start_tangent(double tangent[N_VALUES]) { block_begin_tangent(tangent); }

static double model_substeps(const Model *model, double step) {
    (void)model;
    return step / CYCLE + 2.0;
}

static void model_advance(Model *model, double step) {
    const double end = model->time + step, cycles = model_substeps(model, step);
    for (double i = 0.0; i < cycles && model->next_event < end - EARLY * CYCLE; i++) call(model);
    model->time = end;
}
