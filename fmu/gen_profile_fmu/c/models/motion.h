/*
 * A motion of the axes: polynomials between knots, before them at rest at the start, after them at the target, or on
 * from there at the final velocity.
 * Its numbers lie in motion_table.h, which is generated.
 */
#ifndef MOTION_H
#define MOTION_H

#include "model.h"
#include "motion_table.h"

enum { N_COMMANDS = 4 };  /* position, velocity, acceleration and jerk of the axes, each a block, from COMMAND on */

/* Begin the motion when it is due, and pass the knots up to the present time; sets segment and next_event. */
static void motion_pass_knots(Model *model);

/* The position as a polynomial of the time from now on, in the present segment; lowest power first. */
static void motion_from_now(const Model *model, double position[N_A][N_POWERS]);

/* A time derivative of such a position, now. */
static double derivative_now(const double position[N_POWERS], int order);

/* Calculate the outputs from COMMAND on. */
static void motion_outputs(Model *model);

/* Push a change of parameters on to the outputs from COMMAND on. */
static void motion_tangent(const Model *model, double tangent[N_VALUES]);

/* As `model_is_sound`. */
static int motion_is_sound(const Model *model);

#endif
