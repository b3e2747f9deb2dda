/*
 * An instance of the FMU: call order, checks, logging and saved states, whatever FMI's version.
 * The statuses are those of FMI 2 and 3, number by number.
 */
#ifndef INSTANCE_H
#define INSTANCE_H

#include <stddef.h>

#include "model.h"

typedef enum { OK, WARNING, DISCARD, FAILED } Status;

/* The standards' states of an instance, as bits so that a function can allow several. */
enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    EVENT = 4,
    CONTINUOUS = 8,
    STEP = 16,
    STEP_FAILED = 32,
    TERMINATED = 64,
    ERRONEOUS = 128,
    ASKING = 256,            /* on the way of a step: for inputs */
    SHOWING = 512,           /* on the way of a step: outputs */
    INITIALIZED = INITIALIZATION | EVENT | CONTINUOUS | STEP | STEP_FAILED | TERMINATED | ERRONEOUS,
    READABLE = INITIALIZED | SHOWING,
    ANY_MODE = INSTANTIATED | INITIALIZED
};

enum { UPDATES_ON_THE_WAY = N_SLOPED_INPUTS > 0 };  /* where inputs may vary within a step */

enum { EVENTS = 1, WARNINGS = 2, ERRORS = 4, ALL_CATEGORIES = EVENTS | WARNINGS | ERRORS };

typedef struct {
    Model model;
    double stop_time;        /* infinite where none was set */
    int mode;
    int outputs_are_stale, derivatives_are_stale;
    int has_experiment;      /* a start time was given */
    int is_integrated;       /* an integrator has set states or completed a step */
} State;

/* What is handed out as a saved state. */
typedef struct {
    void *nothing;           /* null: what importers free that hand over a state where its address belongs */
    State state;
} Snapshot;

/* The same as bytes; the identity rejects another model's, and the checksum what was damaged. */
typedef struct {
    char identity[sizeof MODEL_IDENTITY];
    State state;
    unsigned long long checksum;
} Record;

typedef struct {
    State state;
    Host host;
    char *name;
    int for_model_exchange;
    int logged_categories;
    Record scratch;          /* of bytes on their way, or of the model before a step: too large for a stack */
} Instance;

typedef struct {
    int states_jumped;
    int has_next_event;
    double next_event;
} EventOutcome;

/* Begin a function of the interface: bind `instance`, or leave when the call is out of order. */
#define ENTER(component, allowed, function)                                                            \
    Instance *instance = component;                                                                    \
    if (!instance) return FMI(FAILED);                                                                 \
    if (!(instance->state.mode & (allowed)))                                                           \
        return FMI(fail(instance, "%s must not be called in %s.", function, mode_name(instance->state.mode)))

#define REQUIRE_POINTER(pointer, count, function) \
    if ((count) > 0 && !(pointer)) return FMI(fail(instance, "%s was given a null pointer.", function))

#endif
