/* The functions of FMI 2.0.4 that FMI 3.0 declares otherwise. */

/* ---- inquiry, logging, life cycle ------------------------------------------------------------------------ */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    (void)resources, (void)visible;
    if (!callbacks || !callbacks->allocateMemory || !callbacks->freeMemory) return NULL;
    return create((Host){callbacks}, name, guid, type == fmi2ModelExchange, logging);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop) {
    ENTER(c, INSTANTIATED, "fmi2SetupExperiment");
    (void)tolerance_defined, (void)tolerance; /* max_step rules the error */
    return FMI(set_up(instance, start, stop_defined, stop));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    ENTER(c, INSTANTIATED, "fmi2EnterInitializationMode");
    return FMI(begin_initialization(instance));
}

/* ---- variables ------------------------------------------------------------------------------------------- */

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2Real values[]) {
    ENTER(c, INITIALIZED, "fmi2GetReal");
    REQUIRE_POINTER(references, n, "fmi2GetReal");
    REQUIRE_POINTER(values, n, "fmi2GetReal");
    return FMI(get_reals(instance, references, n, values));
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2Boolean values[]) {
    ENTER(c, INITIALIZED, "fmi2GetBoolean");
    REQUIRE_POINTER(references, n, "fmi2GetBoolean");
    REQUIRE_POINTER(values, n, "fmi2GetBoolean");
    refresh_outputs(&instance->state);
    for (size_t i = 0; i < n; i++) {
        double value = 0.0;
        if (get_value(instance, references[i], BOOLEAN, &value) != OK) return fmi2Error;
        values[i] = value != 0.0 ? fmi2True : fmi2False;
    }
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2Integer values[]) {
    ENTER(c, INITIALIZED, "fmi2GetInteger");
    REQUIRE_POINTER(references, n, "fmi2GetInteger");
    REQUIRE_POINTER(values, n, "fmi2GetInteger");
    refresh_outputs(&instance->state);
    for (size_t i = 0; i < n; i++) {
        double value = 0.0;
        if (get_value(instance, references[i], INTEGER, &value) != OK) return fmi2Error;
        values[i] = (fmi2Integer)value;
    }
    return fmi2OK;
}

enum { SETTING = INSTANTIATED | INITIALIZATION | EVENT | CONTINUOUS | STEP };

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t n, const fmi2Real values[]) {
    ENTER(c, SETTING, "fmi2SetReal");
    REQUIRE_POINTER(references, n, "fmi2SetReal");
    REQUIRE_POINTER(values, n, "fmi2SetReal");
    return FMI(set_reals(instance, references, n, values));
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference references[], size_t n,
                          const fmi2Boolean values[]) {
    ENTER(c, SETTING, "fmi2SetBoolean");
    REQUIRE_POINTER(references, n, "fmi2SetBoolean");
    REQUIRE_POINTER(values, n, "fmi2SetBoolean");
    mark_stale(&instance->state);
    for (size_t i = 0; i < n; i++) {
        if (set_value(instance, references[i], BOOLEAN, values[i] ? 1.0 : 0.0) != OK) return fmi2Error;
    }
    return fmi2OK;
}

/* No strings, and no integers that can be set: these functions accept nothing but empty lists. */
#define NO_VARIABLES(function, Value)                                                                       \
    fmi2Status function(fmi2Component c, const fmi2ValueReference references[], size_t n, Value values[]) {  \
        ENTER(c, ANY_MODE, #function);                                                                      \
        (void)references, (void)values;                                                                     \
        return n == 0 ? fmi2OK : FMI(fail(instance, "%s: there is no such variable.", #function));           \
    }
NO_VARIABLES(fmi2GetString, fmi2String)
NO_VARIABLES(fmi2SetInteger, const fmi2Integer)
NO_VARIABLES(fmi2SetString, const fmi2String)

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t n_unknowns,
                                        const fmi2ValueReference knowns[], size_t n_knowns,
                                        const fmi2Real seed[], fmi2Real sensitivity[]) {
    ENTER(c, INITIALIZED, "fmi2GetDirectionalDerivative");
    REQUIRE_POINTER(unknowns && sensitivity, n_unknowns, "fmi2GetDirectionalDerivative");
    REQUIRE_POINTER(knowns && seed, n_knowns, "fmi2GetDirectionalDerivative");
    return FMI(directional_derivative(instance, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity));
}

/* ---- model exchange -------------------------------------------------------------------------------------- */

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    ENTER(c, EVENT, "fmi2NewDiscreteStates");
    REQUIRE_POINTER(info, 1, "fmi2NewDiscreteStates");
    const EventOutcome outcome = handle_events(instance);
    info->newDiscreteStatesNeeded = fmi2False;
    info->terminateSimulation = fmi2False;
    info->nominalsOfContinuousStatesChanged = fmi2False;
    info->valuesOfContinuousStatesChanged = outcome.states_jumped;
    info->nextEventTimeDefined = outcome.has_next_event;
    info->nextEventTime = outcome.has_next_event ? outcome.next_event : 0.0;
    return fmi2OK;
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t n) {
    ENTER(c, INITIALIZED, "fmi2GetDerivatives");
    REQUIRE_POINTER(derivatives, n, "fmi2GetDerivatives");
    return FMI(get_derivatives(instance, derivatives, n));
}

/* ---- co-simulation --------------------------------------------------------------------------------------- */

static Status set_slope(Instance *instance, unsigned reference, int order, double value) {
    const Variable *variable = find_variable(instance, reference, REAL);
    if (!variable) return FAILED;
    const int axis = (int)reference - SLOPED_INPUTS;
    if (axis < 0 || axis >= N_SLOPED_INPUTS) return fail(instance, "%s takes no time derivatives.", variable->name);
    if (order < 1 || order > N_SLOPES) return fail(instance, "Inputs take derivatives of orders 1 to 3 only.");
    if (!isfinite(value)) return fail(instance, "Derivatives of %s must be finite.", variable->name);
    instance->state.model.slopes[axis][order - 1] = value;
    return OK;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t n,
                                       const fmi2Integer orders[], const fmi2Real values[]) {
    ENTER(c, INSTANTIATED | INITIALIZATION | STEP, "fmi2SetRealInputDerivatives");
    REQUIRE_POINTER(references && orders && values, n, "fmi2SetRealInputDerivatives");
    for (size_t i = 0; i < n; i++) {
        if (set_slope(instance, references[i], orders[i], values[i]) != OK) return fmi2Error;
    }
    return fmi2OK;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t n,
                                        const fmi2Integer orders[], fmi2Real values[]) {
    ENTER(c, INITIALIZED, "fmi2GetRealOutputDerivatives");
    REQUIRE_POINTER(references && orders && values, n, "fmi2GetRealOutputDerivatives");
    return FMI(get_output_derivatives(instance, references, n, orders, values));
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_state_set_before) {
    ENTER(c, STEP, "fmi2DoStep");
    (void)no_state_set_before;
    return FMI(do_step(instance, time, step));
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    ENTER(c, 0, "fmi2CancelStep"); /* steps are never in progress */
    return fmi2OK;
}

enum { STATUS_MODES = STEP | STEP_FAILED | TERMINATED };

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    ENTER(c, STATUS_MODES, "fmi2GetRealStatus");
    REQUIRE_POINTER(value, 1, "fmi2GetRealStatus");
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = instance->state.model.time;
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
        (void)instance, (void)kind, (void)value;                                   \
        return fmi2Discard;                                                        \
    }
NO_STATUS(fmi2GetStatus, fmi2Status)
NO_STATUS(fmi2GetIntegerStatus, fmi2Integer)
NO_STATUS(fmi2GetStringStatus, fmi2String)

/* ---- saved states ---------------------------------------------------------------------------------------- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *handle) {
    ENTER(c, ANY_MODE, "fmi2GetFMUstate");
    REQUIRE_POINTER(handle, 1, "fmi2GetFMUstate");
    return FMI(save(instance, handle));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate handle) {
    ENTER(c, ANY_MODE, "fmi2SetFMUstate");
    REQUIRE_POINTER(handle, 1, "fmi2SetFMUstate");
    return FMI(restore(instance, handle));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *handle) {
    ENTER(c, ANY_MODE, "fmi2FreeFMUstate");
    forget(instance, handle);
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate handle, size_t *size) {
    ENTER(c, ANY_MODE, "fmi2SerializedFMUstateSize");
    REQUIRE_POINTER(handle && size, 1, "fmi2SerializedFMUstateSize");
    *size = sizeof(Record);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate handle, fmi2Byte bytes[], size_t size) {
    ENTER(c, ANY_MODE, "fmi2SerializeFMUstate");
    REQUIRE_POINTER(handle && bytes, 1, "fmi2SerializeFMUstate");
    return FMI(write_bytes(instance, handle, bytes, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *handle) {
    ENTER(c, ANY_MODE, "fmi2DeSerializeFMUstate");
    REQUIRE_POINTER(bytes && handle, 1, "fmi2DeSerializeFMUstate");
    return FMI(read_bytes(instance, bytes, size, handle));
}
