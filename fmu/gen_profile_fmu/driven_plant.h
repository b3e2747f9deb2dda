/* The plant and its drives, free of any interface standard. */
#ifndef DRIVEN_PLANT_H
#define DRIVEN_PLANT_H

#include "variables.h"

typedef struct {
    double values[N_VALUES];     /* every variable; a variable's value reference is its index */
    double reached[N_A];         /* setpoint at the present time, from which the next one is interpolated */
} DrivenPlant;

/* Set every variable to its start value: hanging at rest. */
void plant_reset(DrivenPlant *plant);

/* Put the axes at rest at their start positions. */
void plant_place_axes(DrivenPlant *plant);

/* Compute sway, height and angle of every load from the coordinates. */
void plant_update_outputs(DrivenPlant *plant);

/* Number of integration steps that `step` seconds take. */
double plant_substeps(const DrivenPlant *plant, double step);

/* Move on by `step` seconds. Returns 1 if all values are still finite, else 0. */
int plant_advance(DrivenPlant *plant, double step);

#endif
