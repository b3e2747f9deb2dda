#include "instance.h"

#include <math.h>
#include <stdarg.h>
#include <string.h>

static const struct {
    const char *name;
    int bit;
} CATEGORIES[] = {{"logEvents", EVENTS}, {"logStatusWarning", WARNINGS}, {"logStatusError", ERRORS}};
enum { N_CATEGORIES = sizeof CATEGORIES / sizeof *CATEGORIES };

static const double MAX_SUBSTEPS = 1e7;      /* a longer step is a slip in max_step */
static const double TIME_TOLERANCE = 1e-9;   /* masters add up their steps; relative beyond 1 s */

/* ---- logging ------------------------------------------------------------------------------------------ */

static void report(const Host *host, const char *name, Status status, int category, const char *format,
                   va_list arguments) {
    Message message;
    compose(&message, format, arguments);
    for (int i = 0; i < N_CATEGORIES; i++) {
        if (CATEGORIES[i].bit == category) host_log(host, name, (int)status, CATEGORIES[i].name, message.text);
    }
}

/* Log an event. */
static void tell(const Instance *instance, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    if (instance->logged_categories & EVENTS) report(&instance->host, instance->name, OK, EVENTS, format, arguments);
    va_end(arguments);
}

/* Log an error, after which nothing but a reset helps. */
static Status fail(Instance *instance, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    if (instance->logged_categories & ERRORS) {
        report(&instance->host, instance->name, FAILED, ERRORS, format, arguments);
    }
    va_end(arguments);
    instance->state.mode = ERRONEOUS;
    return FAILED;
}

/* Log that an instance cannot be made. */
static Instance *refuse(const Host *host, const char *name, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    report(host, name ? name : "", FAILED, ERRORS, format, arguments);
    va_end(arguments);
    return NULL;
}

static const char *mode_name(int mode) {
    switch (mode) {
        case INSTANTIATED: return "the mode after instantiation";
        case INITIALIZATION: return "initialization mode";
        case EVENT: return "event mode";
        case CONTINUOUS: return "continuous-time mode";
        case STEP: return "step mode";
        case STEP_FAILED: return "the mode after a failed step";
        case ASKING:
        case SHOWING: return "an intermediate update";
        case TERMINATED: return "the mode after termination";
        default: return "the mode after an error";
    }
}

static Status set_logging(Instance *instance, int on, size_t n, const char *const categories[]) {
    int bits = n == 0 ? ALL_CATEGORIES : 0;
    for (size_t i = 0; i < n; i++) {
        int bit = 0;
        for (int k = 0; k < N_CATEGORIES; k++) {
            if (categories[i] && strcmp(categories[i], CATEGORIES[k].name) == 0) bit = CATEGORIES[k].bit;
        }
        if (!bit) return fail(instance, "An unknown log category was to be switched.");
        bits |= bit;
    }
    if (on) instance->logged_categories |= bits;
    else instance->logged_categories &= ~bits;
    return OK;
}

/* ---- creation and life cycle -------------------------------------------------------------------------- */

static void mark_stale(State *state) { state->outputs_are_stale = state->derivatives_are_stale = 1; }

static void reset(Instance *instance) {
    State *state = &instance->state;
    memset(state, 0, sizeof *state);
    for (int i = 0; i < N_VALUES; i++) state->model.values[i] = VARIABLES[i].start;
    state->stop_time = HUGE_VAL;
    state->mode = INSTANTIATED;
    mark_stale(state);
}

static Instance *create(Host host, const char *name, const char *identity, int for_model_exchange, int logging) {
    if (!name || !*name) return refuse(&host, name, "An instance needs a name.");
    if (!identity || strcmp(identity, MODEL_IDENTITY) != 0) {
        return refuse(&host, name, "The identity in the model description is not the binary's, %s.", MODEL_IDENTITY);
    }
    Instance *instance = host_allocate(&host, sizeof *instance);
    char *copy = instance ? host_allocate(&host, strlen(name) + 1) : NULL;
    if (!copy) {
        if (instance) host_free(&host, instance);
        return refuse(&host, name, "There is no memory for an instance.");
    }
    instance->host = host;
    instance->name = strcpy(copy, name);
    instance->for_model_exchange = for_model_exchange;
    instance->logged_categories = logging ? ALL_CATEGORIES : WARNINGS | ERRORS;
    reset(instance);
    tell(instance, "Instantiated.");
    return instance;
}

static void discard(Instance *instance) {
    const Host host = instance->host;
    host_free(&host, instance->name);
    host_free(&host, instance);
}

static Status set_up(Instance *instance, double start, int has_stop, double stop) {
    if (!isfinite(start)) return fail(instance, "The start time must be finite.");
    if (has_stop && !(isfinite(stop) && stop >= start)) {
        return fail(instance, "The stop time must be finite and not before the start time.");
    }
    instance->state.model.time = instance->state.model.start_time = start;
    instance->state.stop_time = has_stop ? stop : HUGE_VAL;
    instance->state.has_experiment = 1;
    return OK;
}

static Status begin_initialization(Instance *instance) {
    if (!instance->state.has_experiment) return fail(instance, "The experiment must be set up before initialization.");
    instance->state.mode = INITIALIZATION;
    return OK;
}

static Status end_initialization(Instance *instance) {
    model_start(&instance->state.model);
    mark_stale(&instance->state);
    instance->state.mode = instance->for_model_exchange ? EVENT : STEP;
    tell(instance, "Initialized at time %g s.", instance->state.model.time);
    return OK;
}

static Status terminate(Instance *instance) {
    instance->state.mode = TERMINATED;
    tell(instance, "Terminated at time %g s.", instance->state.model.time);
    return OK;
}

/* ---- variables ---------------------------------------------------------------------------------------- */

static void refresh_outputs(State *state) {
    if (state->mode == INITIALIZATION) model_start(&state->model);
    if (state->outputs_are_stale) model_outputs(&state->model);
    state->model.values[TIME] = state->model.time;
    state->outputs_are_stale = 0;
}

static void refresh_derivatives(State *state) {
    if (state->derivatives_are_stale) model_derivatives(&state->model);
    state->derivatives_are_stale = 0;
}

static const Variable *find_variable(Instance *instance, unsigned reference, Type type) {
    static const char *const TYPES[] = {"real", "boolean", "integer"};
    if (reference >= N_VALUES) fail(instance, "There is no variable of reference %u.", reference);
    else if (VARIABLES[reference].type == type) return &VARIABLES[reference];
    else fail(instance, "%s is no %s variable.", VARIABLES[reference].name, TYPES[type]);
    return NULL;
}

static Status get_value(Instance *instance, unsigned reference, Type type, double *value) {
    const Variable *variable = find_variable(instance, reference, type);
    if (!variable) return FAILED;
    if (variable->kind == DERIVATIVE) refresh_derivatives(&instance->state);
    *value = instance->state.model.values[reference];
    return OK;
}

static Status get_reals(Instance *instance, const unsigned references[], size_t n, double values[]) {
    refresh_outputs(&instance->state);
    for (size_t i = 0; i < n; i++) {
        if (get_value(instance, references[i], REAL, &values[i]) != OK) return FAILED;
    }
    return OK;
}

static int is_state(unsigned reference) {
    const int index = (int)reference - STATES;
    return index >= 0 && index < N_STATES;
}

static int can_be_set(unsigned reference, int mode) {
    const int starting = INSTANTIATED | INITIALIZATION;
    switch (VARIABLES[reference].kind) {
        case FIXED_PARAMETER:
        case STATE: return mode & starting;
        case TUNABLE_PARAMETER:
        case DISCRETE_INPUT: return mode & (starting | EVENT | STEP);
        case INPUT: return mode & (starting | EVENT | CONTINUOUS | STEP | ASKING);
        default: return 0;
    }
}

/*
 * Whether a state or parameter may be set by name in continuous-time mode, where FMI takes states as a whole and no
 * parameters: CasADi's DaeBuilder does it. No other importer may: it evaluates only, and so leaves the functions alone that
 * an integrator calls.
 */
static int is_explored(const State *state, unsigned reference) {
    const int known = is_state(reference) || VARIABLES[reference].kind == TUNABLE_PARAMETER;
    return known && state->mode == CONTINUOUS && !state->is_integrated;
}

static Status set_value(Instance *instance, unsigned reference, Type type, double value) {
    const Variable *variable = find_variable(instance, reference, type);
    if (!variable) return FAILED;
    const int mode = instance->state.mode;
    if (!can_be_set(reference, mode) && !is_explored(&instance->state, reference)) {
        if (can_be_set(reference, ANY_MODE)) {
            return fail(instance, "%s cannot be set in %s.", variable->name, mode_name(mode));
        }
        return fail(instance, "%s is an output, it cannot be set.", variable->name);
    }
    if (!isfinite(value)) return fail(instance, "%s must be finite, found %g.", variable->name, value);
    if (value < variable->lower || value > variable->upper) {
        return fail(instance, "%s must lie between %g and %g, found %g.", variable->name, variable->lower,
                    variable->upper, value);
    }
    instance->state.model.values[reference] = value;
    return OK;
}

static Status set_reals(Instance *instance, const unsigned references[], size_t n, const double values[]) {
    mark_stale(&instance->state);
    for (size_t i = 0; i < n; i++) {
        if (set_value(instance, references[i], REAL, values[i]) != OK) return FAILED;
    }
    return OK;
}

/* Time derivatives of outputs, each of an order of its own. */
static Status get_output_derivatives(Instance *instance, const unsigned references[], size_t n, const int orders[],
                                     double values[]) {
#if OUTPUT_ORDERS == 0
    (void)references, (void)orders, (void)values;
    return n == 0 ? OK : fail(instance, "Time derivatives of outputs are not given.");
#else
    refresh_outputs(&instance->state);
    for (size_t i = 0; i < n; i++) {
        const Variable *variable = find_variable(instance, references[i], REAL);
        if (!variable) return FAILED;
        if (orders[i] < 1 || orders[i] > OUTPUT_ORDERS) {
            return fail(instance, "Time derivatives of outputs have orders 1 to %u.", (unsigned)OUTPUT_ORDERS);
        }
        if (!model_output_derivative(&instance->state.model, references[i], orders[i], &values[i])) {
            return fail(instance, "Time derivatives of %s are not given.", variable->name);
        }
    }
    return OK;
#endif
}

/* ---- derivatives with respect to variables --------------------------------------------------------------- */

static Status require_knowns(Instance *instance, const unsigned knowns[], size_t n) {
    for (size_t i = 0; i < n; i++) {
        const Variable *variable = find_variable(instance, knowns[i], REAL);
        if (!variable) return FAILED;
        if (!is_state(knowns[i]) && !can_be_set(knowns[i], ANY_MODE)) return fail(instance, "%s is not a known.", variable->name);
    }
    return OK;
}

static void push(Instance *instance, double tangent[N_VALUES]) {
    refresh_outputs(&instance->state);
    if (instance->state.mode == INITIALIZATION) model_start_tangent(tangent);
    model_tangent(&instance->state.model, tangent);
}

static Status directional_derivative(Instance *instance, const unsigned unknowns[], size_t n_unknowns,
                                     const unsigned knowns[], size_t n_knowns, const double seed[],
                                     double sensitivity[]) {
    double tangent[N_VALUES] = {0.0};
    if (require_knowns(instance, knowns, n_knowns) != OK) return FAILED;
    for (size_t i = 0; i < n_knowns; i++) tangent[knowns[i]] = seed[i];
    push(instance, tangent);
    for (size_t i = 0; i < n_unknowns; i++) {
        if (!find_variable(instance, unknowns[i], REAL)) return FAILED;
        sensitivity[i] = tangent[unknowns[i]];
    }
    return OK;
}

/* ---- model exchange ------------------------------------------------------------------------------------- */

static Status set_time(Instance *instance, double time) {
    if (!isfinite(time)) return fail(instance, "The time must be finite.");
    instance->state.model.time = time;
    mark_stale(&instance->state);
    return OK;
}

/* As memcpy, which must not be given the null pointer of an empty list. */
static void copy_values(double *to, const double *from, size_t n) {
    for (size_t i = 0; i < n; i++) to[i] = from[i];
}

static Status set_states(Instance *instance, const double states[], size_t n) {
    if (n != N_STATES) return fail(instance, "There are %u continuous states.", (unsigned)N_STATES);
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(states[i])) return fail(instance, "%s must be finite.", VARIABLES[STATES + i].name);
    }
    copy_values(instance->state.model.values + STATES, states, n);
    instance->state.is_integrated = 1;
    mark_stale(&instance->state);
    return OK;
}

static Status get_states(Instance *instance, double states[], size_t n) {
    if (n != N_STATES) return fail(instance, "There are %u continuous states.", (unsigned)N_STATES);
    refresh_outputs(&instance->state);
    copy_values(states, instance->state.model.values + STATES, n);
    return OK;
}

static Status get_derivatives(Instance *instance, double derivatives[], size_t n) {
    if (n != N_STATES) return fail(instance, "There are %u continuous states.", (unsigned)N_STATES);
    refresh_outputs(&instance->state);
    refresh_derivatives(&instance->state);
    copy_values(derivatives, instance->state.model.values + DERIVATIVES, n);
    return OK;
}

static Status get_nominals(Instance *instance, double nominals[], size_t n) {
    if (n != N_STATES) return fail(instance, "There are %u continuous states.", (unsigned)N_STATES);
    for (size_t i = 0; i < n; i++) nominals[i] = VARIABLES[STATES + i].nominal;
    return OK;
}

static Status complete_step(Instance *instance) {
    instance->state.is_integrated = 1;
    return OK;
}

static EventOutcome handle_events(Instance *instance) {
    Model *model = &instance->state.model;
    EventOutcome outcome = {.states_jumped = model_event(model), .next_event = model->next_event};
    outcome.has_next_event = outcome.next_event < HUGE_VAL;
    mark_stale(&instance->state);
    return outcome;
}

/* ---- co-simulation -------------------------------------------------------------------------------------- */

static double time_tolerance(double time) { return TIME_TOLERANCE * fmax(1.0, fabs(time)); }

static Status require_step(Instance *instance, double time, double step) {
    const State *state = &instance->state;
    if (!(fabs(time - state->model.time) <= time_tolerance(state->model.time))) {
        return fail(instance, "The step begins at %g s, but the FMU has reached %g s.", time, state->model.time);
    }
    if (!(isfinite(step) && step > 0.0)) return fail(instance, "The step size must be positive, found %g.", step);
    if (time + step > state->stop_time + time_tolerance(state->stop_time)) {
        return fail(instance, "The step leads to %g s, beyond the stop time %g s.", time + step, state->stop_time);
    }
    if (model_substeps(&state->model, step) > MAX_SUBSTEPS) {
        return fail(instance, "A step of %g s takes more than %g integration steps; raise max_step.", step,
                    MAX_SUBSTEPS);
    }
    return OK;
}

/* Call the importer back. Returns whether it left the instance as it should. */
static int call_back(Instance *instance, int mode, double time) {
    instance->state.mode = mode;
    mark_stale(&instance->state);
    host_update(&instance->host, time, mode == ASKING);
    if (instance->state.mode != mode) return 0;
    instance->state.mode = STEP;
    return 1;
}

/*
 * Advance in integration steps, for an importer that wants to take part: it is asked for the inputs at the middle of
 * each, whose values hold for the whole of it (so that the error is of second order), and shown the outputs at the end.
 */
static int advance_with_updates(Instance *instance, double step) {
    Model *model = &instance->state.model;
    const double start = model->time;
    const long pieces = (long)model_substeps(model, step);
    for (long i = 1; i <= pieces; i++) {
        const double piece = start + step * (double)i / (double)pieces - model->time;
        if (!call_back(instance, ASKING, model->time + 0.5 * piece)) return 0;
        model_advance(model, piece);
        if (!call_back(instance, SHOWING, model->time)) return 0;
    }
    return 1;
}

static Status do_step(Instance *instance, double time, double step) {
    State *state = &instance->state;
    if (require_step(instance, time, step) != OK) return FAILED;
    Model *before = &instance->scratch.state.model;
    *before = state->model;
    state->model.time = time;
    if (!UPDATES_ON_THE_WAY || !host_takes_updates(&instance->host)) model_advance(&state->model, step);
    else if (!advance_with_updates(instance, step)) return FAILED;
    mark_stale(state);
    for (int i = STATES; i < STATES + N_STATES; i++) {
        if (isfinite(state->model.values[i])) continue;
        fail(instance, "The state is no longer finite after %g s.", time);
        state->model = *before;
        state->mode = STEP_FAILED;
        return DISCARD;
    }
    state->model.time = time + step;
    return OK;
}

/* ---- saved states --------------------------------------------------------------------------------------- */

/* Hand a state out, in the memory of `handle` or in memory of its own. */
static Status keep(Instance *instance, const State *state, void **handle) {
    Snapshot *snapshot = *handle ? *handle : host_allocate(&instance->host, sizeof *snapshot);
    if (!snapshot) return fail(instance, "There is no memory for an FMU state.");
    snapshot->nothing = NULL;
    memcpy(&snapshot->state, state, sizeof *state);
    *handle = snapshot;
    return OK;
}

static Status save(Instance *instance, void **handle) { return keep(instance, &instance->state, handle); }

static Status restore(Instance *instance, const void *handle) {
    memcpy(&instance->state, &((const Snapshot *)handle)->state, sizeof instance->state);
    return OK;
}

static void forget(Instance *instance, void **handle) {
    if (!handle || !*handle) return;
    host_free(&instance->host, *handle);
    *handle = NULL;
}

/* FNV-1a of a record up to its checksum: a byte that has changed changes it. */
static unsigned long long checksum_of(const Record *record) {
    const unsigned char *bytes = (const unsigned char *)record;
    unsigned long long hash = 0xcbf29ce484222325ULL;
    for (size_t i = 0; i < offsetof(Record, checksum); i++) hash = (hash ^ bytes[i]) * 0x100000001b3ULL;
    return hash;
}

static int are_values_sound(const Model *model) {
    for (unsigned i = 0; i < N_VALUES; i++) {
        const double value = model->values[i];
        if (can_be_set(i, ANY_MODE) && !(value >= VARIABLES[i].lower && value <= VARIABLES[i].upper)) return 0;
    }
    return 1;
}

/* Whether a run can go on from a state, whichever instance made it. */
static int is_sound(const State *state) {
    const Model *model = &state->model;
    const int mode = state->mode, is_one_mode = mode > 0 && (mode & (mode - 1)) == 0 && (mode & ANY_MODE) == mode;
    const int flags =
        state->outputs_are_stale | state->derivatives_are_stale | state->has_experiment | state->is_integrated;
    return is_one_mode && (flags & ~1) == 0 && isfinite(model->time) && isfinite(model->start_time) &&
           !isnan(state->stop_time) && !isnan(model->next_event) && are_values_sound(model) && model_is_sound(model);
}

static Status write_bytes(Instance *instance, const void *handle, void *bytes, size_t size) {
    if (size < sizeof(Record)) return fail(instance, "The buffer is too small for the FMU state.");
    Record *record = &instance->scratch;
    memset(record, 0, sizeof *record);
    memcpy(record->identity, MODEL_IDENTITY, sizeof record->identity);
    memcpy(&record->state, &((const Snapshot *)handle)->state, sizeof record->state);
    record->checksum = checksum_of(record);
    memcpy(bytes, record, sizeof *record);
    return OK;
}

static Status read_bytes(Instance *instance, const void *bytes, size_t size, void **handle) {
    Record *record = &instance->scratch;
    if (size != sizeof *record || memcmp(bytes, MODEL_IDENTITY, sizeof MODEL_IDENTITY) != 0) {
        return fail(instance, "The bytes are not a state of this FMU.");
    }
    memcpy(record, bytes, sizeof *record);
    if (record->checksum != checksum_of(record) || !is_sound(&record->state)) {
        return fail(instance, "The bytes of the FMU state are damaged.");
    }
    return keep(instance, &record->state, handle);
}
