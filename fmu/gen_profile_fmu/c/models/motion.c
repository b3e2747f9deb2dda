/*
 * The motion at any time. Which segment holds is kept, so that an integrator can end a step upon a knot; that decides
 * at the knot itself only, because not every importer stops there before it looks beyond.
 *
 * Axes go from `start` as far as `distance` says: the motion that was planned is shifted and scaled.
 */
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

static int motion_is_sound(const Model *model) {
    if (model->segment == -1) return model->began == HUGE_VAL;
    return model->segment >= 0 && model->segment <= N_SEGMENTS && isfinite(model->began);
}

/* Time since the motion began; negative before. */
static double elapsed(const Model *model) {
    if (model->segment >= 0) return model->time - model->began;
    return model->values[WAIT] == 0.0 ? model->time - model->values[START_TIME] : -1.0;
}

/* The segment at the present time: -1 before the motion, N_SEGMENTS after it. */
static int present_segment(const Model *model) {
    const double since = elapsed(model), rounding = EVENT_TOLERANCE * fabs(model->time);
    int segment = model->segment;
    while (segment < N_SEGMENTS && since > (segment < 0 ? 0.0 : KNOTS[segment + 1]) + rounding) segment++;
    while (segment >= 0 && since < KNOTS[segment] - rounding) segment--;
    return segment;
}

/* As planned, before it is shifted and scaled: as `motion_from_now`. */
static void planned_from_now(const Model *model, double position[N_A][N_POWERS]) {
    const int segment = present_segment(model);
    memset(position, 0, N_A * sizeof *position);
    for (int i = 0; i < N_A; i++) {
        if (segment < 0) position[i][0] = COEFFICIENTS[0][0][i];
        else if (segment == N_SEGMENTS) {
            const double beyond = elapsed(model) - KNOTS[N_SEGMENTS];
            position[i][0] = TARGET[i] + beyond * FINAL_VELOCITY[i];
            position[i][1] = FINAL_VELOCITY[i];
        } else {
            const double since = elapsed(model) - KNOTS[segment];
            for (int j = 0; j < N_POWERS; j++) position[i][j] = COEFFICIENTS[segment][j][i];
            /* Horner's scheme, repeated, shifts the polynomial's origin */
            for (int low = 0; low < N_POWERS - 1; low++) {
                for (int j = N_POWERS - 2; j >= low; j--) position[i][j] += since * position[i][j + 1];
            }
        }
    }
}

/* How far axis i was planned to go; 0 where it comes back, which no distance scales. */
static double planned_distance(int i) { return VARIABLES[DISTANCE + i].start; }

static void motion_from_now(const Model *model, double position[N_A][N_POWERS]) {
    planned_from_now(model, position);
    const double *values = model->values;
    for (int i = 0; i < N_A; i++) {
        const double planned = planned_distance(i);
        const double scale = planned != 0.0 ? values[DISTANCE + i] / planned : 1.0;
        for (int j = 0; j < N_POWERS; j++) position[i][j] *= scale;
        position[i][0] += values[START + i] - scale * COEFFICIENTS[0][0][i];
    }
}

static double derivative_now(const double position[N_POWERS], int order) {
    double factorial = 1.0;
    for (int k = 2; k <= order; k++) factorial *= k;
    return order < N_POWERS ? factorial * position[order] : 0.0;
}

static void motion_outputs(Model *model) {
    double position[N_A][N_POWERS];
    motion_from_now(model, position);
    for (int order = 0; order < N_COMMANDS; order++) {
        for (int i = 0; i < N_A; i++) {
            model->values[COMMAND + order * N_A + i] = derivative_now(position[i], order);
        }
    }
}

static void motion_tangent(const Model *model, double tangent[N_VALUES]) {
    double planned[N_A][N_POWERS], position[N_A][N_POWERS];
    planned_from_now(model, planned);
    motion_from_now(model, position);
    /* what waits for a trigger does not begin later because start_time does, and stands still before it begins */
    const double later = model->values[WAIT] == 0.0 ? tangent[START_TIME] : 0.0;
    for (int i = 0; i < N_A; i++) {
        const double distance = planned_distance(i);
        const double farther = distance != 0.0 ? tangent[DISTANCE + i] / distance : 0.0;
        planned[i][0] -= COEFFICIENTS[0][0][i];
        for (int order = 0; order < N_COMMANDS; order++) {
            tangent[COMMAND + order * N_A + i] = (order == 0 ? tangent[START + i] : 0.0) +
                                                 farther * derivative_now(planned[i], order) -
                                                 later * derivative_now(position[i], order + 1);
        }
    }
}
