/* A motion and the plant whose drives follow it, piece by piece between the knots. */
#include <math.h>
#include <string.h>

#include "driven_plant.h"
#include "motion.h"

static void model_start(Model *model) {
    model->began = HUGE_VAL;
    model->segment = -1;
    plant_start(model, model->values + START);
    motion_pass_knots(model);
}

static int model_event(Model *model) {
    motion_pass_knots(model);
    return 0;
}

static int model_is_sound(const Model *model) { return motion_is_sound(model); }

static void model_outputs(Model *model) {
    motion_outputs(model);
    plant_outputs(model);
}

static void accelerations(const Model *model, double acceleration[N_A]) {
    double position[N_A][N_POWERS];
    const double tau = model->values[TAU];
    motion_from_now(model, position);
    for (int i = 0; i < N_A; i++) {
        acceleration[i] = tau > 0.0 ? (position[i][1] - model->values[DQ_A + i]) / tau : 2.0 * position[i][2];
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
    motion_tangent(model, tangent);
    for (int i = 0; i < N_A; i++) {
        const double *asked = tangent + COMMAND + i; /* position, velocity, acceleration */
        const double lacking = asked[N_A] - tangent[DQ_A + i] - acceleration[i] * tangent[TAU];
        change[i] = tau > 0.0 ? lacking / tau : asked[2 * N_A];
    }
    plant_tangent(model, acceleration, change, tangent);
}

static void model_start_tangent(double tangent[N_VALUES]) {
    memcpy(tangent + Q_A, tangent + START, N_A * sizeof *tangent);
}

static double model_substeps(const Model *model, double step) {
    return plant_substeps(model, model->values[TAU], step);
}

static void follow(Model *model, double step) {
    double position[N_A][N_POWERS], reference[N_A][N_ORDERS];
    motion_from_now(model, position);
    for (int i = 0; i < N_A; i++) {
        model->reached[i] = position[i][0];
        for (int j = 0; j < N_ORDERS; j++) reference[i][j] = (j + 1) * position[i][j + 1];
    }
    plant_drive(model, model->values[TAU], reference, step);
}

static void model_advance(Model *model, double step) {
    const double end = model->time + step;
    motion_pass_knots(model);
    while (model->time < end) {
        const double stop = fmin(end, model->next_event);
        follow(model, stop - model->time);
        model->time = stop;
        motion_pass_knots(model);
    }
}
