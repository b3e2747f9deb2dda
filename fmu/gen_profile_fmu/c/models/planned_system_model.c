/*
 * A planner block and the plant that it drives: in every cycle the block issues a setpoint, to which the drives then go
 * on evenly, as drives that interpolate do (CiA 402, object 60C2h), to reach it when the next cycle begins.
 *
 * In co-simulation the cycles that begin within a step are called with the inputs of the step's beginning. In model
 * exchange each cycle is a time event.
 */
#include <math.h>
#include <string.h>

#include "driven_plant.h"

static const double EARLY = 1e-6;  /* of a cycle: masters add up their steps, and a cycle is the next step's then */

static void model_start(Model *model) {
    plant_start(model, model->values + START);
    for (int i = 0; i < N_LED; i++) model->values[COMMAND + i] = model->values[START + LED[i]];
    block_begin(&model->block, model->values);
    model->samples = 0;
    model->next_event = model->start_time;
}

/* Where an axis is asked to be: by the block or, if that does not plan it, by an input. */
static double asked(const Model *model, int i) { return model->values[ASKED[i]]; }

static void call(Model *model) {
    block_call(&model->block, model->values);
    block_show(&model->block, model->values);
    for (int i = 0; i < N_A; i++) model->held[i] = (asked(model, i) - model->reached[i]) / CYCLE;
    model->samples++;
    model->next_event = model->start_time + model->samples * CYCLE;
}

static int model_event(Model *model) {
    if (is_come(model, model->next_event)) {
        call(model);
        for (int i = 0; i < N_A; i++) model->reached[i] = asked(model, i);
    }
    return model->values[TAU] == 0.0 && plant_jump(model, model->held);
}

static int model_is_sound(const Model *model) { return model->samples >= 0; }

static void model_outputs(Model *model) {
    block_show(&model->block, model->values);
    plant_outputs(model);
}

static void accelerations(const Model *model, double acceleration[N_A]) {
    const double tau = model->values[TAU];
    for (int i = 0; i < N_A; i++) {
        acceleration[i] = tau > 0.0 ? (model->held[i] - model->values[DQ_A + i]) / tau : 0.0;
    }
}

static void model_derivatives(Model *model) {
    double acceleration[N_A];
    accelerations(model, acceleration);
    plant_derivatives(model, acceleration);
}

static void model_tangent(const Model *model, double tangent[N_VALUES]) {
    double acceleration[N_A], change[N_A];
    const double tau = model->values[TAU];
    accelerations(model, acceleration);
    for (int i = 0; i < N_A; i++) {
        change[i] = tau > 0.0 ? (-tangent[DQ_A + i] - acceleration[i] * tangent[TAU]) / tau : 0.0;
    }
    plant_tangent(model, acceleration, change, tangent);
}

static void model_start_tangent(double tangent[N_VALUES]) {
    memcpy(tangent + Q_A, tangent + START, N_A * sizeof *tangent);
    for (int i = 0; i < N_LED; i++) tangent[COMMAND + i] = tangent[START + LED[i]];
    block_begin_tangent(tangent);
}

static double model_substeps(const Model *model, double step) {
    return plant_substeps(model, model->values[TAU], step) + step / CYCLE + 2.0;
}

static void follow(Model *model, double step) {
    double reference[N_A][N_ORDERS];
    for (int i = 0; i < N_A; i++) reference[i][0] = model->held[i];
    plant_drive(model, model->values[TAU], reference, step);
}

static void model_advance(Model *model, double step) {
    const double end = model->time + step, early = EARLY * CYCLE;
    while (model->time < end) {
        if (model->next_event < model->time + early) call(model);
        const double stop = model->next_event < end - early ? model->next_event : end;
        follow(model, stop - model->time);
        model->time = stop;
    }
}
