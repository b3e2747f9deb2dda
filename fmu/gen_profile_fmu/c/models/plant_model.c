/*
 * A plant with inputs: what its drives are asked for, as accelerations, velocities or positions.
 *
 * ACCELERATION_INPUT: the axes have it at once. VELOCITY_INPUT: drives follow it, with a lag or at once. Both are
 * polynomials of time within a step where their derivatives were given, else constant. In model exchange, where a
 * velocity that is followed at once would need a derivative, drives without lag hold one every `interpolation_period`.
 * SETPOINT_INPUT: drives that interpolate their setpoints linearly (CiA 402, object 60C2h). Between two setpoints
 * the reference velocity is constant, (new - reached) / period. In co-simulation a step is a period, at whose end
 * the setpoint is reached; in model exchange drives take a setpoint every `interpolation_period`.
 */
#include <math.h>
#include <string.h>

#include "driven_plant.h"

static double lag(const Model *model) { return INPUT_KIND == ACCELERATION_INPUT ? 0.0 : model->values[TAU]; }

/* Whether, in model exchange, the drives take their inputs at times of their own. */
static int takes_samples(const Model *model) {
    return INPUT_KIND == SETPOINT_INPUT || (INPUT_KIND == VELOCITY_INPUT && lag(model) == 0.0);
}

static void model_start(Model *model) {
    plant_start(model, model->values + START);
    model->samples = 0;
    model->next_event = takes_samples(model) ? model->start_time : HUGE_VAL;
}

static int model_is_sound(const Model *model) { return model->samples >= 0; }

/* Let the drives go for their setpoints, to reach them at the next sample. */
static void take_setpoints(Model *model, double period) {
    for (int i = 0; i < N_A; i++) {
        model->held[i] = (model->values[INPUTS + i] - model->reached[i]) / period;
        model->reached[i] = model->values[INPUTS + i];
    }
}

static int model_event(Model *model) {
    if (!takes_samples(model)) return 0;
    if (is_come(model, model->next_event)) {
        const double period = model->values[PERIOD];
        if (INPUT_KIND == SETPOINT_INPUT) take_setpoints(model, period);
        model->samples++;
        model->next_event = model->start_time + model->samples * period;
    }
    /* a velocity may change at any event */
    return lag(model) == 0.0 && plant_jump(model, INPUT_KIND == SETPOINT_INPUT ? model->held : model->values + INPUTS);
}

static void model_outputs(Model *model) { plant_outputs(model); }

/* What the drives do at present; how it changes with lag, velocity and input follows from the same equation. */
static void accelerations(const Model *model, double acceleration[N_A]) {
    const double tau = lag(model);
    for (int i = 0; i < N_A; i++) {
        const double input = model->values[INPUTS + i];
        if (INPUT_KIND == ACCELERATION_INPUT) {
            acceleration[i] = input;
        } else {
            const double reference = INPUT_KIND == VELOCITY_INPUT ? input : model->held[i];
            acceleration[i] = tau > 0.0 ? (reference - model->values[DQ_A + i]) / tau : 0.0;
        }
    }
}

static void model_derivatives(Model *model) {
    double acceleration[N_A];
    accelerations(model, acceleration);
    plant_derivatives(model, acceleration);
}

static void model_tangent(const Model *model, double tangent[N_VALUES]) {
    double acceleration[N_A], change[N_A];
    const double tau = lag(model);
    accelerations(model, acceleration);
    for (int i = 0; i < N_A; i++) {
        const double input = INPUT_KIND == SETPOINT_INPUT ? 0.0 : tangent[INPUTS + i];
        if (INPUT_KIND == ACCELERATION_INPUT) change[i] = input;
        else change[i] = tau > 0.0 ? (input - tangent[DQ_A + i] - acceleration[i] * tangent[TAU]) / tau : 0.0;
    }
    plant_tangent(model, acceleration, change, tangent);
}

static void model_start_tangent(double tangent[N_VALUES]) {
    memcpy(tangent + Q_A, tangent + START, N_A * sizeof *tangent);
}

static double model_substeps(const Model *model, double step) { return plant_substeps(model, lag(model), step); }

static void taylor(double *coefficients, double value, const double slopes[N_SLOPES]) {
    double factorial = 1.0;
    coefficients[0] = value;
    for (int k = 1; k <= N_SLOPES; k++) {
        factorial *= k;
        coefficients[k] = slopes[k - 1] / factorial;
    }
}

/* The reference velocity that the inputs ask for during a step. */
static void reference_velocity(const Model *model, double step, double reference[N_A][N_ORDERS]) {
    for (int i = 0; i < N_A; i++) {
        const double input = model->values[INPUTS + i];
        double *r = reference[i];
        switch (INPUT_KIND) {
            case SETPOINT_INPUT:
                r[0] = (input - model->reached[i]) / step;
                break;
            case VELOCITY_INPUT:
                taylor(r, input, model->slopes[i]);
                break;
            default:
                r[0] = model->values[DQ_A + i];
                taylor(r + 1, input, model->slopes[i]);
                for (int j = 2; j < N_ORDERS; j++) r[j] /= j;
        }
    }
}

/* Put the axes to where the setpoints are reached, whatever rounding did on the way. */
static void settle(Model *model, double tau, const double position[N_A]) {
    for (int i = 0; i < N_A; i++) {
        model->reached[i] = position[i];
        model->values[Q_A + i] = position[i] - tau * model->values[DQ_A + i];
    }
}

static void model_advance(Model *model, double step) {
    double reference[N_A][N_ORDERS];
    reference_velocity(model, step, reference);
    plant_drive(model, lag(model), reference, step);
    if (INPUT_KIND == SETPOINT_INPUT) settle(model, lag(model), model->values + INPUTS);
    memset(model->slopes, 0, sizeof model->slopes);
    model->time += step;
}
