/*
 * What an FMU's model is to the interfaces of FMI, whose names and types it does not know.
 *
 * variables.h, which is generated, lists the variables. The continuous states lie side by side from STATES on,
 * their derivatives in the same order from DERIVATIVES on.
 */
#ifndef MODEL_H
#define MODEL_H

#include <math.h>

#include "variables.h"

#ifdef HAS_BLOCK
#include "planner_block.h"
#endif

enum { N_SLOPES = 3 };             /* time derivatives of an input that a step takes */

static const double EVENT_TOLERANCE = 1e-13;  /* relative */

typedef struct {
    double values[N_VALUES];       /* every variable; a variable's value reference is its index */
    double time;
    double start_time;
    double next_event;             /* time of the next event; infinite where none is to come */
    double reached[N_A];           /* where the drives' reference velocity has led to: position + tau * velocity */
    double held[N_A];              /* reference velocity between two samples of a setpoint, in model exchange */
    double slopes[N_A][N_SLOPES];  /* time derivatives of the inputs from SLOPED_INPUTS on, for the coming step */
    double began;                  /* when the motion began; infinite before */
    int segment;                   /* of the motion; -1 before it, N_SEGMENTS after it */
    int samples;                   /* setpoints taken in model exchange, or cycles of a block */
#ifdef HAS_BLOCK
    PlannerBlock block;            /* with all that it remembers */
#endif
} Model;

/*
 * Whether an event's time is come, but for rounding: importers take a communication point that is as good as an event's
 * time for it, and would find the event due again at once, too soon for an integrator.
 */
static int is_come(const Model *model, double event) {
    return event - model->time <= EVENT_TOLERANCE * fabs(model->time);
}

/* Set what follows from the parameters at the start, as often as they change. */
static void model_start(Model *model);

/* Act on what happens at the present time. Returns whether states jumped. Sets next_event. */
static int model_event(Model *model);

/* Whether no value but those of variables lies where it would lead out of a table or into an endless step. */
static int model_is_sound(const Model *model);

/* Calculate the outputs from the states, the parameters and the time. */
static void model_outputs(Model *model);

#if OUTPUT_ORDERS > 0
/* A time derivative of an output, at present. Returns whether it is known. */
static int model_output_derivative(const Model *model, unsigned output, int order, double *value);
#endif

/* Calculate the derivatives of the continuous states. */
static void model_derivatives(Model *model);

/* Push a change of states, inputs and parameters on to outputs and derivatives; both lie in `tangent`. */
static void model_tangent(const Model *model, double tangent[N_VALUES]);

/* Bring the changes of parameters to what they set at the start. */
static void model_start_tangent(double tangent[N_VALUES]);

/* Number of integration steps that `step` seconds take. */
static double model_substeps(const Model *model, double step);

/* Move states and time on by `step` seconds. */
static void model_advance(Model *model, double step);

#endif
