/*
 * Drives with a first-order lag, and the plant that hangs on them.
 *
 * A drive follows tau dv/dt = r(t) - v for a polynomial r, solved in closed form:
 *
 *     v(t) = w(t) - (w(0) - v(0)) exp(-t / tau),   w = r - tau r' + tau^2 r'' - ...
 *
 * Without lag v is r itself: the axis velocity jumps by dv at the beginning, and with it the unactuated rates by
 * -M_uu^-1 M_au^T dv. In both cases position + tau * velocity moves on by the integral of r.
 * The unactuated coordinates are integrated by the classical Runge-Kutta method of fourth order. While a lag fades,
 * a step at the time t is e^(t / 5 tau) tau / 30 long: so all steps err alike, and however short the lag is, 155 of
 * them see it through.
 */
#include "driven_plant.h"

#include <math.h>
#include <string.h>

#include "equations.h"

enum { N_X = 2 * N_U };                /* q_u and dq_u lie side by side in the values */
static const double STEPS_PER_LAG = 30.0;  /* at first */
static const double GROWTH = 5.0;          /* lags in which steps become e times as long */
static const double MOST_FADING = 155.0;   /* steps until they are as long as wanted */
static const double NEGLIGIBLE = 1e-13;    /* m/s (or rad/s) by which a step may miss what is left of a lag */

typedef struct {
    double tau;
    const double *reached;
    double (*reference)[N_ORDERS];
    double response[N_A][N_ORDERS];    /* w, as a polynomial */
    double lacking[N_A];               /* w(0) - v(0) */
} Drives;

typedef struct {
    double position[N_A], velocity[N_A], acceleration[N_A];
} AxisMotion;

static double polynomial(const double coefficients[N_ORDERS], double time) {
    double value = 0.0;
    for (int i = N_ORDERS - 1; i >= 0; i--) value = value * time + coefficients[i];
    return value;
}

static double derivative_of(const double coefficients[N_ORDERS], double time) {
    double value = 0.0;
    for (int i = N_ORDERS - 1; i >= 1; i--) value = value * time + i * coefficients[i];
    return value;
}

static double integral_of(const double coefficients[N_ORDERS], double time) {
    double value = 0.0;
    for (int i = N_ORDERS - 1; i >= 0; i--) value = (value + coefficients[i] / (i + 1)) * time;
    return value;
}

static Drives drives_along(const Model *model, double tau, double reference[N_A][N_ORDERS]) {
    Drives drives = {.tau = tau, .reached = model->reached, .reference = reference};
    for (int i = 0; i < N_A; i++) {
        double *response = drives.response[i];
        double above = 0.0;
        for (int j = N_ORDERS - 1; j >= 0; j--) above = response[j] = reference[i][j] - tau * (j + 1) * above;
        drives.lacking[i] = tau > 0.0 ? response[0] - model->values[DQ_A + i] : 0.0;
    }
    return drives;
}

static AxisMotion motion_after(const Drives *drives, double time) {
    AxisMotion axes;
    const double tau = drives->tau;
    const double decay = tau > 0.0 ? exp(-time / tau) : 0.0;
    for (int i = 0; i < N_A; i++) {
        const double lacking = drives->lacking[i] * decay;
        axes.velocity[i] = polynomial(drives->response[i], time) - lacking;
        axes.acceleration[i] = derivative_of(drives->response[i], time) + (tau > 0.0 ? lacking / tau : 0.0);
        axes.position[i] = drives->reached[i] + integral_of(drives->reference[i], time) - tau * axes.velocity[i];
    }
    return axes;
}

static void evaluate(Equation *equation, const double *x, const AxisMotion *axes, const double *input,
                     const double *parameters, double *result) {
    const double *arguments[] = {x, x + N_U, axes->position, axes->velocity, input, parameters};
    double *results[] = {result};
    equation(arguments, results, NULL, NULL, 0);
}

static void derivative(const double *x, const AxisMotion *axes, const double *parameters, double *dx) {
    memcpy(dx, x + N_U, N_U * sizeof *dx);
    evaluate(equations_acceleration, x, axes, axes->acceleration, parameters, dx + N_U);
}

static void runge_kutta_step(double *x, const Drives *drives, double time, double step, const double *parameters) {
    const AxisMotion start = motion_after(drives, time);
    const AxisMotion middle = motion_after(drives, time + 0.5 * step);
    const AxisMotion end = motion_after(drives, time + step);
    double k1[N_X], k2[N_X], k3[N_X], k4[N_X], stage[N_X];

    derivative(x, &start, parameters, k1);
    for (int i = 0; i < N_X; i++) stage[i] = x[i] + 0.5 * step * k1[i];
    derivative(stage, &middle, parameters, k2);
    for (int i = 0; i < N_X; i++) stage[i] = x[i] + 0.5 * step * k2[i];
    derivative(stage, &middle, parameters, k3);
    for (int i = 0; i < N_X; i++) stage[i] = x[i] + step * k3[i];
    derivative(stage, &end, parameters, k4);
    for (int i = 0; i < N_X; i++) x[i] += step / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
}

/* The axes as the values have them, with accelerations given. */
static AxisMotion present_axes(const double *values, const double acceleration[N_A]) {
    AxisMotion axes;
    memcpy(axes.position, values + Q_A, sizeof axes.position);
    memcpy(axes.velocity, values + DQ_A, sizeof axes.velocity);
    memcpy(axes.acceleration, acceleration, sizeof axes.acceleration);
    return axes;
}

static void plant_start(Model *model, const double position[N_A]) {
    for (int i = 0; i < N_A; i++) {
        model->values[Q_A + i] = model->reached[i] = position[i];
        model->values[DQ_A + i] = model->held[i] = 0.0;
    }
}

static int plant_jump(Model *model, const double velocity[N_A]) {
    double *values = model->values;
    double dv[N_A], rates[N_U];
    int jumped = 0;
    for (int i = 0; i < N_A; i++) {
        dv[i] = velocity[i] - values[DQ_A + i];
        jumped = jumped || dv[i] != 0.0;
    }
    if (!jumped) return 0;
    const AxisMotion axes = present_axes(values, dv);
    evaluate(equations_jump, values + Q_U, &axes, dv, values + P, rates);
    memcpy(values + DQ_A, velocity, sizeof dv);
    for (int i = 0; i < N_U; i++) values[DQ_U + i] += rates[i];
    return 1;
}

static double evenly(double step, double longest) {
    return fmax(1.0, ceil(step / longest * (1.0 - 1e-12)));  /* 4 ms in steps of 1 ms are 4, not 5 */
}

static double plant_substeps(const Model *model, double tau, double step) {
    const double while_fading = tau > 0.0 ? ceil(fmin(STEPS_PER_LAG * step / tau, MOST_FADING)) : 0.0;
    return fmax(while_fading, evenly(step, model->values[MAX_STEP]));
}

/* Whether a step over which the drives come closer to what they follow has to be cut for that. */
static int fading(const Drives *drives, double step) {
    double most = 0.0;
    for (int i = 0; i < N_A; i++) most = fmax(most, fabs(drives->lacking[i]));
    return drives->tau > 0.0 && most * step > NEGLIGIBLE * drives->tau;
}

/* Integrate while a lag fades, as long as that takes shorter steps than elsewhere. Returns the time reached. */
static double integrate_fading(double *x, const Drives *drives, double step, double longest, const double *parameters) {
    double time = 0.0, size = drives->tau / STEPS_PER_LAG;
    while (size < longest && time + size < step) {
        runge_kutta_step(x, drives, time, size, parameters);
        time += size;
        size = drives->tau / STEPS_PER_LAG * exp(time / (GROWTH * drives->tau));
    }
    return time;
}

static void plant_drive(Model *model, double tau, double reference[N_A][N_ORDERS], double step) {
    double *values = model->values;
    if (tau == 0.0) {
        double velocity[N_A];
        for (int i = 0; i < N_A; i++) velocity[i] = reference[i][0];
        plant_jump(model, velocity);
    }
    const Drives drives = drives_along(model, tau, reference);
    const double longest = values[MAX_STEP];
    const double faded = fading(&drives, fmin(step, longest))
                             ? integrate_fading(values + Q_U, &drives, step, longest, values + P)
                             : 0.0;
    const long substeps = (long)evenly(step - faded, longest);
    const double substep = (step - faded) / (double)substeps;
    for (long i = 0; i < substeps; i++) {
        runge_kutta_step(values + Q_U, &drives, faded + (double)i * substep, substep, values + P);
    }
    const AxisMotion end = motion_after(&drives, step);
    memcpy(values + Q_A, end.position, sizeof end.position);
    memcpy(values + DQ_A, end.velocity, sizeof end.velocity);
    for (int i = 0; i < N_A; i++) model->reached[i] += integral_of(reference[i], step);
}

static void plant_outputs(Model *model) {
    static const double NO_ACCELERATION[N_A] = {0.0};
    double *values = model->values;
    const AxisMotion axes = present_axes(values, NO_ACCELERATION);
    evaluate(equations_outputs, values + Q_U, &axes, axes.acceleration, values + P, values + SWAY);
}

static void plant_derivatives(Model *model, const double acceleration[N_A]) {
    double *values = model->values;
    const AxisMotion axes = present_axes(values, acceleration);
    derivative(values + Q_U, &axes, values + P, values + DERIVATIVES);
    memcpy(values + DERIVATIVES + N_X, axes.velocity, sizeof axes.velocity);
    memcpy(values + DERIVATIVES + N_X + N_A, acceleration, sizeof axes.acceleration);
}

static void plant_tangent(const Model *model, const double acceleration[N_A], const double change[N_A],
                          double tangent[N_VALUES]) {
    const double *values = model->values;
    const double *arguments[] = {values + Q_U,  values + DQ_U,  values + Q_A,  values + DQ_A,  acceleration,
                                 values + P,    tangent + Q_U,  tangent + DQ_U, tangent + Q_A, tangent + DQ_A,
                                 change,        tangent + P};
    double *results[] = {tangent + DERIVATIVES + N_U, tangent + SWAY};
    equations_tangent(arguments, results, NULL, NULL, 0);
    memcpy(tangent + DERIVATIVES, tangent + DQ_U, N_U * sizeof *tangent);
    memcpy(tangent + DERIVATIVES + N_X, tangent + DQ_A, N_A * sizeof *tangent);
    memcpy(tangent + DERIVATIVES + N_X + N_A, change, N_A * sizeof *tangent);
}
