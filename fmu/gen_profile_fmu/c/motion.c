/* The motion at any time; which segment holds is kept, so that an integrator can end a step upon a knot. */
#include "motion.h"

#include <math.h>
#include <string.h>

static int is_due(const Model *model) {
    const double *values = model->values;
    return is_come(model, values[START_TIME]) && (values[WAIT] == 0.0 || values[TRIGGER] != 0.0);
}

static double next_knot(const Model *model) {
    if (model->segment >= 0) return model->segment < N_SEGMENTS ? model->began + KNOTS[model->segment + 1] : HUGE_VAL;
    return is_come(model, model->values[START_TIME]) ? HUGE_VAL : model->values[START_TIME];
}

static void motion_pass_knots(Model *model) {
    if (model->segment < 0 && is_due(model)) {
        /* without a trigger the motion begins on time, even if that lies inside of a step */
        model->began = model->values[WAIT] != 0.0 ? model->time : model->values[START_TIME];
        model->segment = 0;
    }
    while (model->segment >= 0 && is_come(model, next_knot(model))) model->segment++;
    model->next_event = next_knot(model);
    model->values[MOVING] = model->segment >= 0 && model->segment < N_SEGMENTS;
    model->values[DONE] = model->segment == N_SEGMENTS;
}

static void motion_from_now(const Model *model, double position[N_A][N_POWERS]) {
    memset(position, 0, N_A * sizeof *position);
    for (int i = 0; i < N_A; i++) {
        if (model->segment < 0) position[i][0] = COEFFICIENTS[0][0][i];
        else if (model->segment == N_SEGMENTS) {
            const double beyond = model->time - model->began - KNOTS[N_SEGMENTS];
            position[i][0] = TARGET[i] + beyond * FINAL_VELOCITY[i];
            position[i][1] = FINAL_VELOCITY[i];
        } else {
            const double since = model->time - model->began - KNOTS[model->segment];
            for (int j = 0; j < N_POWERS; j++) position[i][j] = COEFFICIENTS[model->segment][j][i];
            /* Horner's scheme, repeated, shifts the polynomial's origin */
            for (int low = 0; low < N_POWERS - 1; low++) {
                for (int j = N_POWERS - 2; j >= low; j--) position[i][j] += since * position[i][j + 1];
            }
        }
    }
}

static void motion_outputs(Model *model) {
    double position[N_A][N_POWERS];
    motion_from_now(model, position);
    for (int i = 0; i < N_A; i++) {
        double *values = model->values + COMMAND + i;
        values[0 * N_A] = position[i][0];
        values[1 * N_A] = position[i][1];
        values[2 * N_A] = 2.0 * position[i][2];
        values[3 * N_A] = 6.0 * position[i][3];
    }
}
