/* FMI 2.0 co-simulation interface of a driven plant: call order, checks, logging and FMU states. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "driven_plant.h"
#include "fmi2Functions.h"
#include "identity.h"

/* States of the standard's co-simulation state machine, as bits so that a function can allow several. */
enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    STEP_COMPLETE = 4,
    STEP_FAILED = 8,
    TERMINATED = 16,
    ERRONEOUS = 32,
    ANY_MODE = INSTANTIATED | INITIALIZATION | STEP_COMPLETE | STEP_FAILED | TERMINATED | ERRONEOUS
};

enum { EVENTS = 1, WARNINGS = 2, ERRORS = 4, ALL_CATEGORIES = EVENTS | WARNINGS | ERRORS };

static const struct {
    const char *name;
    int bit;
} CATEGORIES[] = {{"logEvents", EVENTS}, {"logStatusWarning", WARNINGS}, {"logStatusError", ERRORS}};
enum { N_CATEGORIES = sizeof CATEGORIES / sizeof *CATEGORIES };

static const double MAX_SUBSTEPS = 1e7;      /* a longer step is a slip in max_step or tau */
static const double TIME_TOLERANCE = 1e-9;   /* masters add up their steps; relative beyond 1 s */

typedef struct {
    DrivenPlant plant;
    double time;
    double stop_time;        /* infinite where none was set */
    int mode;
    int outputs_are_stale;
} State;

typedef struct {
    State state;
    const fmi2CallbackFunctions *callbacks;
    char *name;
    int logged_categories;
} Instance;

/* What is handed out as fmi2FMUstate; the identity rejects another model's bytes. */
typedef struct {
    char guid[sizeof MODEL_GUID];
    State state;
} Snapshot;

/* ---- logging and checks ------------------------------------------------------------------------------ */

/* Messages are complete texts without a percent sign: they are safe as the format string that FMI wants. */
static void report(const Instance *instance, fmi2Status status, int category, const char *format, ...) {
    char text[512];
    va_list arguments;
    if (!instance->callbacks->logger || !(instance->logged_categories & category)) return;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    for (int i = 0; i < N_CATEGORIES; i++) {
        if (CATEGORIES[i].bit == category) {
            instance->callbacks->logger(instance->callbacks->componentEnvironment, instance->name, status,
                                        CATEGORIES[i].name, text);
        }
    }
}

#define FAIL(instance, ...) \
    (report(instance, fmi2Error, ERRORS, __VA_ARGS__), (instance)->state.mode = ERRONEOUS, fmi2Error)

/* Begin a function of the interface: bind `instance`, or leave when the call is out of order. */
#define ENTER(component, allowed, function)                                                            \
    Instance *instance = component;                                                                    \
    if (!instance) return fmi2Error;                                                                   \
    if (!(instance->state.mode & (allowed)))                                                           \
        return FAIL(instance, "%s must not be called in %s.", function, mode_name(instance->state.mode))

#define REQUIRE_POINTER(pointer, count, function) \
    if ((count) > 0 && !(pointer)) return FAIL(instance, "%s was given a null pointer.", function)

static const char *mode_name(int mode) {
    switch (mode) {
        case INSTANTIATED: return "the mode after instantiation";
        case INITIALIZATION: return "initialization mode";
        case STEP_COMPLETE: return "step mode";
        case STEP_FAILED: return "the mode after a failed step";
        case TERMINATED: return "the mode after termination";
        default: return "the mode after an error";
    }
}

static int category_bit(const char *name) {
    for (int i = 0; i < N_CATEGORIES; i++) {
        if (name && strcmp(name, CATEGORIES[i].name) == 0) return CATEGORIES[i].bit;
    }
    return 0;
}

static double time_tolerance(double time) { return TIME_TOLERANCE * fmax(1.0, fabs(time)); }

static void reset(Instance *instance) {
    plant_reset(&instance->state.plant);
    instance->state.time = 0.0;
    instance->state.stop_time = HUGE_VAL;
    instance->state.mode = INSTANTIATED;
    instance->state.outputs_are_stale = 1;
}

/* ---- inquiry and logging ------------------------------------------------------------------------------ */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    ENTER(c, ANY_MODE, "fmi2SetDebugLogging");
    REQUIRE_POINTER(categories, n, "fmi2SetDebugLogging");
    int bits = n == 0 ? ALL_CATEGORIES : 0;
    for (size_t i = 0; i < n; i++) {
        const int bit = category_bit(categories[i]);
        if (!bit) return FAIL(instance, "fmi2SetDebugLogging was given an unknown log category.");
        bits |= bit;
    }
    if (on) instance->logged_categories |= bits;
    else instance->logged_categories &= ~bits;
    return fmi2OK;
}

/* ---- creation and life cycle -------------------------------------------------------------------------- */

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    (void)resources;
    (void)visible;
    if (!callbacks || !callbacks->allocateMemory || !callbacks->freeMemory) return NULL;
    Instance unborn = {.callbacks = callbacks, .name = (char *)(name ? name : ""), .logged_categories = ERRORS};
    if (!name || !*name) {
        report(&unborn, fmi2Error, ERRORS, "fmi2Instantiate needs an instance name.");
        return NULL;
    }
    if (type != fmi2CoSimulation) {
        report(&unborn, fmi2Error, ERRORS, "This FMU is for co-simulation only.");
        return NULL;
    }
    if (!guid || strcmp(guid, MODEL_GUID) != 0) {
        report(&unborn, fmi2Error, ERRORS, "The GUID of the model description is not the binary's, " MODEL_GUID ".");
        return NULL;
    }
    Instance *instance = callbacks->allocateMemory(1, sizeof *instance);
    char *copy = instance ? callbacks->allocateMemory(strlen(name) + 1, sizeof *copy) : NULL;
    if (!copy) {
        report(&unborn, fmi2Error, ERRORS, "There is no memory for an instance.");
        if (instance) callbacks->freeMemory(instance);
        return NULL;
    }
    instance->callbacks = callbacks;
    instance->name = strcpy(copy, name);
    instance->logged_categories = logging ? ALL_CATEGORIES : WARNINGS | ERRORS;
    reset(instance);
    report(instance, fmi2OK, EVENTS, "Instantiated.");
    return instance;
}

void fmi2FreeInstance(fmi2Component c) {
    Instance *instance = c;
    if (!instance) return;
    const fmi2CallbackFunctions *callbacks = instance->callbacks;
    callbacks->freeMemory(instance->name);
    callbacks->freeMemory(instance);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop) {
    ENTER(c, INSTANTIATED, "fmi2SetupExperiment");
    (void)tolerance_defined; /* the step is fixed by max_step */
    (void)tolerance;
    if (!isfinite(start)) return FAIL(instance, "The start time must be finite.");
    if (stop_defined && !(isfinite(stop) && stop >= start)) {
        return FAIL(instance, "The stop time must be finite and not before the start time.");
    }
    instance->state.time = start;
    instance->state.stop_time = stop_defined ? stop : HUGE_VAL;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    ENTER(c, INSTANTIATED, "fmi2EnterInitializationMode");
    instance->state.mode = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    ENTER(c, INITIALIZATION, "fmi2ExitInitializationMode");
    plant_place_axes(&instance->state.plant);
    instance->state.outputs_are_stale = 1;
    instance->state.mode = STEP_COMPLETE;
    report(instance, fmi2OK, EVENTS, "Initialized at time %g s.", instance->state.time);
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    ENTER(c, STEP_COMPLETE | STEP_FAILED, "fmi2Terminate");
    instance->state.mode = TERMINATED;
    report(instance, fmi2OK, EVENTS, "Terminated at time %g s.", instance->state.time);
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    ENTER(c, ANY_MODE, "fmi2Reset");
    reset(instance);
    report(instance, fmi2OK, EVENTS, "Reset.");
    return fmi2OK;
}

/* ---- variables ---------------------------------------------------------------------------------------- */

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2Real values[]) {
    ENTER(c, ANY_MODE & ~INSTANTIATED, "fmi2GetReal");
    REQUIRE_POINTER(references, n, "fmi2GetReal");
    REQUIRE_POINTER(values, n, "fmi2GetReal");
    State *state = &instance->state;
    if (state->mode == INITIALIZATION) plant_place_axes(&state->plant);
    if (state->outputs_are_stale) plant_update_outputs(&state->plant);
    state->outputs_are_stale = 0;
    for (size_t i = 0; i < n; i++) {
        if (references[i] >= N_VALUES) return FAIL(instance, "There is no variable of reference %u.", references[i]);
        values[i] = state->plant.values[references[i]];
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t n, const fmi2Real values[]) {
    ENTER(c, INSTANTIATED | INITIALIZATION | STEP_COMPLETE, "fmi2SetReal");
    REQUIRE_POINTER(references, n, "fmi2SetReal");
    REQUIRE_POINTER(values, n, "fmi2SetReal");
    for (size_t i = 0; i < n; i++) {
        if (references[i] >= N_VALUES) return FAIL(instance, "There is no variable of reference %u.", references[i]);
        const Variable *variable = &VARIABLES[references[i]];
        if (variable->kind == OUTPUT) return FAIL(instance, "%s is an output, it cannot be set.", variable->name);
        if (variable->kind == FIXED_PARAMETER && instance->state.mode == STEP_COMPLETE) {
            return FAIL(instance, "%s can be set only before the first step.", variable->name);
        }
        if (!isfinite(values[i])) return FAIL(instance, "%s must be finite, found %g.", variable->name, values[i]);
        if (values[i] < variable->lower || values[i] > variable->upper) {
            return FAIL(instance, "%s must lie between %g and %g, found %g.", variable->name, variable->lower,
                        variable->upper, values[i]);
        }
        instance->state.plant.values[references[i]] = values[i];
    }
    instance->state.outputs_are_stale = 1;
    return fmi2OK;
}

/* All variables are reals: the other types' functions accept nothing but empty lists. */
#define NO_VARIABLES(function, Value)                                                                      \
    fmi2Status function(fmi2Component c, const fmi2ValueReference references[], size_t n, Value values[]) { \
        ENTER(c, ANY_MODE, #function);                                                                     \
        (void)references;                                                                                  \
        (void)values;                                                                                      \
        return n == 0 ? fmi2OK : FAIL(instance, "%s: every variable is a real.", #function);               \
    }
NO_VARIABLES(fmi2GetInteger, fmi2Integer)
NO_VARIABLES(fmi2GetBoolean, fmi2Boolean)
NO_VARIABLES(fmi2GetString, fmi2String)
NO_VARIABLES(fmi2SetInteger, const fmi2Integer)
NO_VARIABLES(fmi2SetBoolean, const fmi2Boolean)
NO_VARIABLES(fmi2SetString, const fmi2String)

/* ---- steps -------------------------------------------------------------------------------------------- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_state_set_before) {
    ENTER(c, STEP_COMPLETE, "fmi2DoStep");
    (void)no_state_set_before;
    State *state = &instance->state;
    if (!(fabs(time - state->time) <= time_tolerance(state->time))) {
        return FAIL(instance, "The step begins at %.12g s, but the FMU has reached %.12g s.", time, state->time);
    }
    if (!(isfinite(step) && step > 0.0)) return FAIL(instance, "The step size must be positive, found %g.", step);
    if (time + step > state->stop_time + time_tolerance(state->stop_time)) {
        return FAIL(instance, "The step leads to %.12g s, beyond the stop time %.12g s.", time + step,
                    state->stop_time);
    }
    if (plant_substeps(&state->plant, step) > MAX_SUBSTEPS) {
        return FAIL(instance, "A step of %g s takes more than %g integration steps; raise max_step or tau.", step,
                    MAX_SUBSTEPS);
    }
    const DrivenPlant before = state->plant;
    if (!plant_advance(&state->plant, step)) {
        state->plant = before;
        state->mode = STEP_FAILED;
        report(instance, fmi2Discard, ERRORS, "The state is no longer finite after %.12g s.", time);
        return fmi2Discard;
    }
    state->time = time + step;
    state->outputs_are_stale = 1;
    return fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    ENTER(c, 0, "fmi2CancelStep"); /* steps are never in progress */
    return fmi2OK;
}

enum { STATUS_MODES = STEP_COMPLETE | STEP_FAILED | TERMINATED };

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    ENTER(c, STATUS_MODES, "fmi2GetRealStatus");
    REQUIRE_POINTER(value, 1, "fmi2GetRealStatus");
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = instance->state.time;
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    ENTER(c, STATUS_MODES, "fmi2GetBooleanStatus");
    REQUIRE_POINTER(value, 1, "fmi2GetBooleanStatus");
    if (kind != fmi2Terminated) return fmi2Discard;
    *value = fmi2False; /* the FMU never asks to be terminated */
    return fmi2OK;
}

/* What remains to be asked is about steps that run in the background: there are none. */
#define NO_STATUS(function, Value)                                                 \
    fmi2Status function(fmi2Component c, const fmi2StatusKind kind, Value *value) { \
        ENTER(c, STATUS_MODES, #function);                                         \
        (void)instance;                                                            \
        (void)kind;                                                                \
        (void)value;                                                               \
        return fmi2Discard;                                                        \
    }
NO_STATUS(fmi2GetStatus, fmi2Status)
NO_STATUS(fmi2GetIntegerStatus, fmi2Integer)
NO_STATUS(fmi2GetStringStatus, fmi2String)

/* ---- FMU states --------------------------------------------------------------------------------------- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *handle) {
    ENTER(c, ANY_MODE, "fmi2GetFMUstate");
    REQUIRE_POINTER(handle, 1, "fmi2GetFMUstate");
    Snapshot *snapshot = *handle;
    if (!snapshot) snapshot = instance->callbacks->allocateMemory(1, sizeof *snapshot);
    if (!snapshot) return FAIL(instance, "There is no memory for an FMU state.");
    memcpy(snapshot->guid, MODEL_GUID, sizeof snapshot->guid);
    snapshot->state = instance->state;
    *handle = snapshot;
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate handle) {
    ENTER(c, ANY_MODE, "fmi2SetFMUstate");
    REQUIRE_POINTER(handle, 1, "fmi2SetFMUstate");
    instance->state = ((const Snapshot *)handle)->state;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *handle) {
    ENTER(c, ANY_MODE, "fmi2FreeFMUstate");
    if (handle && *handle) {
        instance->callbacks->freeMemory(*handle);
        *handle = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate handle, size_t *size) {
    ENTER(c, ANY_MODE, "fmi2SerializedFMUstateSize");
    REQUIRE_POINTER(handle && size, 1, "fmi2SerializedFMUstateSize");
    *size = sizeof(Snapshot);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate handle, fmi2Byte bytes[], size_t size) {
    ENTER(c, ANY_MODE, "fmi2SerializeFMUstate");
    REQUIRE_POINTER(handle && bytes, 1, "fmi2SerializeFMUstate");
    if (size < sizeof(Snapshot)) return FAIL(instance, "The buffer is too small for the FMU state.");
    memcpy(bytes, handle, sizeof(Snapshot));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *handle) {
    ENTER(c, ANY_MODE, "fmi2DeSerializeFMUstate");
    REQUIRE_POINTER(bytes && handle, 1, "fmi2DeSerializeFMUstate");
    if (size != sizeof(Snapshot) || memcmp(bytes, MODEL_GUID, sizeof MODEL_GUID) != 0) {
        return FAIL(instance, "The bytes are not a state of this FMU.");
    }
    Snapshot *snapshot = *handle;
    if (!snapshot) snapshot = instance->callbacks->allocateMemory(1, sizeof *snapshot);
    if (!snapshot) return FAIL(instance, "There is no memory for an FMU state.");
    memcpy(snapshot, bytes, sizeof *snapshot);
    *handle = snapshot;
    return fmi2OK;
}

/* ---- capabilities that the model description does not claim -------------------------------------------- */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t n,
                                       const fmi2Integer orders[], const fmi2Real values[]) {
    ENTER(c, ANY_MODE, "fmi2SetRealInputDerivatives");
    (void)references, (void)n, (void)orders, (void)values;
    return FAIL(instance, "This FMU takes no input derivatives.");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t n,
                                        const fmi2Integer orders[], fmi2Real values[]) {
    ENTER(c, ANY_MODE, "fmi2GetRealOutputDerivatives");
    (void)references, (void)n, (void)orders, (void)values;
    return FAIL(instance, "This FMU gives no output derivatives.");
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t n_unknowns,
                                        const fmi2ValueReference knowns[], size_t n_knowns,
                                        const fmi2Real seed[], fmi2Real sensitivity[]) {
    ENTER(c, ANY_MODE, "fmi2GetDirectionalDerivative");
    (void)unknowns, (void)n_unknowns, (void)knowns, (void)n_knowns, (void)seed, (void)sensitivity;
    return FAIL(instance, "This FMU gives no directional derivatives.");
}
