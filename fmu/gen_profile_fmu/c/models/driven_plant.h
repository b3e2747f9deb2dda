/* A plant on its drives, which follow a reference velocity. */
#ifndef DRIVEN_PLANT_H
#define DRIVEN_PLANT_H

#include "model.h"

/* Hanging at rest, or as the states' start values say, with the axes at rest at `position`. */
static void plant_start(Model *model, const double position[N_A]);

/*
 * Move on by `step` seconds while the drives, whose lag is `tau`, follow reference velocities: polynomials of the
 * time since the beginning, lowest power first.
 */
static void plant_drive(Model *model, double tau, double reference[N_A][N_ORDERS], double step);

/* Let drives without lag take up new velocities at once. Returns whether any did. */
static int plant_jump(Model *model, const double velocity[N_A]);

static double plant_substeps(const Model *model, double tau, double step);

static void plant_outputs(Model *model);

/* Calculate the states' derivatives, given the axes' accelerations. */
static void plant_derivatives(Model *model, const double acceleration[N_A]);

/* As `model_tangent`, given the axes' accelerations and their change. */
static void plant_tangent(const Model *model, const double acceleration[N_A], const double change[N_A],
                          double tangent[N_VALUES]);

#endif
