/*
 * Drives that interpolate their setpoints linearly, and the plant that hangs on them.
 *
 * Between two setpoints (CiA 402, object 60C2h) the reference velocity of an axis is constant,
 * v_ref = (new - reached) / step. An ideal drive, tau = 0, takes it at once: the axis velocity jumps by dv,
 * and with it the unactuated rates by -M_uu^-1 M_au^T dv. A drive with lag follows tau dv/dt = v_ref - v,
 * solved in closed form; from rest, position + tau * velocity equals the interpolated setpoint.
 * The unactuated coordinates are integrated by the classical Runge-Kutta method of fourth order.
 */
#include "driven_plant.h"

#include <math.h>
#include <string.h>

#include "plant_equations.h"

enum { N_X = 2 * N_U };                /* q_u and dq_u lie side by side in the values */
static const double SUBSTEPS_PER_LAG = 20.0;

typedef struct {
    double tau;
    double from[N_A], to[N_A];         /* setpoints at the step's ends */
    double velocity[N_A];              /* at the step's beginning */
    double reference[N_A];             /* v_ref */
} Drives;

typedef struct {
    double position[N_A], velocity[N_A], acceleration[N_A];
} AxisMotion;

static void evaluate(Equation *equation, const double *x, const AxisMotion *axes, const double *input,
                     const double *parameters, double *result) {
    const double *arguments[] = {x, x + N_U, axes->position, axes->velocity, input, parameters};
    double *results[] = {result};
    equation(arguments, results, NULL, NULL, 0);
}

static AxisMotion motion_after(const Drives *drives, double time) {
    AxisMotion axes;
    const double tau = drives->tau;
    const double decay = tau > 0.0 ? exp(-time / tau) : 0.0;
    for (int i = 0; i < N_A; i++) {
        const double lacking = (drives->reference[i] - drives->velocity[i]) * decay;
        axes.velocity[i] = drives->reference[i] - lacking;
        axes.acceleration[i] = tau > 0.0 ? lacking / tau : 0.0;
        axes.position[i] = drives->from[i] + drives->reference[i] * time - tau * axes.velocity[i];
    }
    return axes;
}

static void derivative(const double *x, const AxisMotion *axes, const double *parameters, double *dx) {
    memcpy(dx, x + N_U, N_U * sizeof *dx);
    evaluate(plant_acceleration, x, axes, axes->acceleration, parameters, dx + N_U);
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

/* Let ideal drives take up their new velocities. */
static void jump(double *x, Drives *drives, const double *parameters) {
    const AxisMotion axes = motion_after(drives, 0.0);
    double dv[N_A], rates[N_U];
    for (int i = 0; i < N_A; i++) {
        dv[i] = drives->reference[i] - drives->velocity[i];
        drives->velocity[i] = drives->reference[i];
    }
    evaluate(plant_jump, x, &axes, dv, parameters, rates);
    for (int i = 0; i < N_U; i++) x[N_U + i] += rates[i];
}

static Drives drives_for(const DrivenPlant *plant, double step) {
    Drives drives;
    drives.tau = plant->values[TAU];
    for (int i = 0; i < N_A; i++) {
        drives.from[i] = plant->reached[i];
        drives.to[i] = plant->values[SETPOINT + i];
        drives.velocity[i] = plant->values[DQ_A + i];
        drives.reference[i] = (drives.to[i] - drives.from[i]) / step;
    }
    return drives;
}

void plant_reset(DrivenPlant *plant) {
    for (int i = 0; i < N_VALUES; i++) plant->values[i] = VARIABLES[i].start;
    plant_place_axes(plant);
}

void plant_place_axes(DrivenPlant *plant) {
    for (int i = 0; i < N_A; i++) plant->values[Q_A + i] = plant->reached[i] = plant->values[START + i];
}

void plant_update_outputs(DrivenPlant *plant) {
    double *values = plant->values;
    AxisMotion axes = {{0.0}, {0.0}, {0.0}};
    memcpy(axes.position, values + Q_A, sizeof axes.position);
    evaluate(plant_outputs, values + Q_U, &axes, axes.acceleration, values + P, values + SWAY);
}

double plant_substeps(const DrivenPlant *plant, double step) {
    double longest = plant->values[MAX_STEP];
    const double tau = plant->values[TAU];
    if (tau > 0.0 && tau < SUBSTEPS_PER_LAG * longest) longest = tau / SUBSTEPS_PER_LAG;
    return fmax(1.0, ceil(step / longest * (1.0 - 1e-12)));  /* 4 ms in steps of 1 ms are 4, not 5 */
}

int plant_advance(DrivenPlant *plant, double step) {
    double *values = plant->values;
    double *x = values + Q_U;
    Drives drives = drives_for(plant, step);
    const long substeps = (long)plant_substeps(plant, step);
    const double substep = step / (double)substeps;

    if (drives.tau == 0.0) jump(x, &drives, values + P);
    for (long i = 0; i < substeps; i++) runge_kutta_step(x, &drives, (double)i * substep, substep, values + P);

    const AxisMotion end = motion_after(&drives, step);
    int finite = 1;
    for (int i = 0; i < N_A; i++) {
        values[DQ_A + i] = end.velocity[i];
        values[Q_A + i] = drives.to[i] - drives.tau * end.velocity[i];
        plant->reached[i] = drives.to[i];
        finite = finite && isfinite(values[Q_A + i]) && isfinite(values[DQ_A + i]);
    }
    for (int i = 0; i < N_X; i++) finite = finite && isfinite(x[i]);
    return finite;
}
