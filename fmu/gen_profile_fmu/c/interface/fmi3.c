/* The functions of FMI 3.0 that FMI 2.0 declares otherwise. */

/* ---- inquiry, logging, life cycle ------------------------------------------------------------------------ */

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging,
                                          fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    (void)resources, (void)visible;
    return create((Host){environment, log, NULL}, name, token, 1, logging);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
                                         const fmi3ValueReference intermediate[], size_t n_intermediate,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    (void)resources, (void)visible, (void)early_return, (void)intermediate;
    const Host host = {environment, log, update};
    if (event_mode) return refuse(&host, name, "Event mode in co-simulation is not provided.");
    if (n_intermediate > 0 && !UPDATES_ON_THE_WAY) return refuse(&host, name, "Intermediate updates are not provided.");
    return create(host, name, token, 0, logging);
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
    (void)token, (void)resources, (void)visible, (void)logging, (void)update, (void)lock, (void)unlock;
    const Host host = {environment, log, NULL};
    return refuse(&host, name, "Scheduled execution is not provided.");
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop) {
    ENTER(c, INSTANTIATED, "fmi3EnterInitializationMode");
    (void)tolerance_defined, (void)tolerance; /* max_step rules the error */
    if (set_up(instance, start, stop_defined, stop) != OK) return fmi3Error;
    return FMI(begin_initialization(instance));
}

/* ---- variables ------------------------------------------------------------------------------------------- */

#define REQUIRE_SIZE(n, n_values, function) \
    if ((n) != (n_values)) return FMI(fail(instance, "%s: every variable has one value.", function))

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t n, fmi3Float64 values[],
                          size_t n_values) {
    ENTER(c, READABLE, "fmi3GetFloat64");
    REQUIRE_POINTER(references && values, n, "fmi3GetFloat64");
    REQUIRE_SIZE(n, n_values, "fmi3GetFloat64");
    return FMI(get_reals(instance, references, n, values));
}

fmi3Status fmi3GetBoolean(fmi3Instance c, const fmi3ValueReference references[], size_t n, fmi3Boolean values[],
                          size_t n_values) {
    ENTER(c, READABLE, "fmi3GetBoolean");
    REQUIRE_POINTER(references && values, n, "fmi3GetBoolean");
    REQUIRE_SIZE(n, n_values, "fmi3GetBoolean");
    refresh_outputs(&instance->state);
    for (size_t i = 0; i < n; i++) {
        double value = 0.0;
        if (get_value(instance, references[i], BOOLEAN, &value) != OK) return fmi3Error;
        values[i] = value != 0.0;
    }
    return fmi3OK;
}

fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference references[], size_t n, fmi3Int32 values[],
                        size_t n_values) {
    ENTER(c, READABLE, "fmi3GetInt32");
    REQUIRE_POINTER(references && values, n, "fmi3GetInt32");
    REQUIRE_SIZE(n, n_values, "fmi3GetInt32");
    refresh_outputs(&instance->state);
    for (size_t i = 0; i < n; i++) {
        double value = 0.0;
        if (get_value(instance, references[i], INTEGER, &value) != OK) return fmi3Error;
        values[i] = (fmi3Int32)value;
    }
    return fmi3OK;
}

enum { SETTING = INSTANTIATED | INITIALIZATION | EVENT | CONTINUOUS | STEP | ASKING };

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t n,
                          const fmi3Float64 values[], size_t n_values) {
    ENTER(c, SETTING, "fmi3SetFloat64");
    REQUIRE_POINTER(references && values, n, "fmi3SetFloat64");
    REQUIRE_SIZE(n, n_values, "fmi3SetFloat64");
    return FMI(set_reals(instance, references, n, values));
}

fmi3Status fmi3SetBoolean(fmi3Instance c, const fmi3ValueReference references[], size_t n,
                          const fmi3Boolean values[], size_t n_values) {
    ENTER(c, SETTING, "fmi3SetBoolean");
    REQUIRE_POINTER(references && values, n, "fmi3SetBoolean");
    REQUIRE_SIZE(n, n_values, "fmi3SetBoolean");
    mark_stale(&instance->state);
    for (size_t i = 0; i < n; i++) {
        if (set_value(instance, references[i], BOOLEAN, values[i] ? 1.0 : 0.0) != OK) return fmi3Error;
    }
    return fmi3OK;
}

/* No variables of other types, and no integers that can be set: these functions accept nothing but empty lists. */
#define NONE(function, n) \
    return (n) == 0 ? fmi3OK : FMI(fail(instance, "%s: there is no such variable.", function))

#define NO_VARIABLES(function, Value)                                                                      \
    fmi3Status function(fmi3Instance c, const fmi3ValueReference references[], size_t n, Value values[],    \
                        size_t n_values) {                                                                 \
        ENTER(c, ANY_MODE, #function);                                                                     \
        (void)references, (void)values, (void)n_values;                                                    \
        NONE(#function, n);                                                                                \
    }
NO_VARIABLES(fmi3GetFloat32, fmi3Float32)
NO_VARIABLES(fmi3GetInt8, fmi3Int8)
NO_VARIABLES(fmi3GetUInt8, fmi3UInt8)
NO_VARIABLES(fmi3GetInt16, fmi3Int16)
NO_VARIABLES(fmi3GetUInt16, fmi3UInt16)
NO_VARIABLES(fmi3GetUInt32, fmi3UInt32)
NO_VARIABLES(fmi3GetInt64, fmi3Int64)
NO_VARIABLES(fmi3GetUInt64, fmi3UInt64)
NO_VARIABLES(fmi3GetString, fmi3String)
NO_VARIABLES(fmi3SetFloat32, const fmi3Float32)
NO_VARIABLES(fmi3SetInt8, const fmi3Int8)
NO_VARIABLES(fmi3SetUInt8, const fmi3UInt8)
NO_VARIABLES(fmi3SetInt16, const fmi3Int16)
NO_VARIABLES(fmi3SetUInt16, const fmi3UInt16)
NO_VARIABLES(fmi3SetInt32, const fmi3Int32)
NO_VARIABLES(fmi3SetUInt32, const fmi3UInt32)
NO_VARIABLES(fmi3SetInt64, const fmi3Int64)
NO_VARIABLES(fmi3SetUInt64, const fmi3UInt64)
NO_VARIABLES(fmi3SetString, const fmi3String)

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference references[], size_t n, size_t sizes[],
                         fmi3Binary values[], size_t n_values) {
    ENTER(c, ANY_MODE, "fmi3GetBinary");
    (void)references, (void)sizes, (void)values, (void)n_values;
    NONE("fmi3GetBinary", n);
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference references[], size_t n, const size_t sizes[],
                         const fmi3Binary values[], size_t n_values) {
    ENTER(c, ANY_MODE, "fmi3SetBinary");
    (void)references, (void)sizes, (void)values, (void)n_values;
    NONE("fmi3SetBinary", n);
}

/* ---- derivatives with respect to variables --------------------------------------------------------------- */

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                        const fmi3ValueReference knowns[], size_t n_knowns,
                                        const fmi3Float64 seed[], size_t n_seed, fmi3Float64 sensitivity[],
                                        size_t n_sensitivity) {
    ENTER(c, READABLE, "fmi3GetDirectionalDerivative");
    REQUIRE_POINTER(unknowns && sensitivity, n_unknowns, "fmi3GetDirectionalDerivative");
    REQUIRE_POINTER(knowns && seed, n_knowns, "fmi3GetDirectionalDerivative");
    REQUIRE_SIZE(n_knowns, n_seed, "fmi3GetDirectionalDerivative");
    REQUIRE_SIZE(n_unknowns, n_sensitivity, "fmi3GetDirectionalDerivative");
    return FMI(directional_derivative(instance, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity));
}

static Status adjoint_derivative(Instance *instance, const unsigned unknowns[], size_t n_unknowns,
                                 const unsigned knowns[], size_t n_knowns, const double seed[],
                                 double sensitivity[]) {
    for (size_t j = 0; j < n_knowns; j++) {
        sensitivity[j] = 0.0;
        for (size_t i = 0; i < n_unknowns; i++) {
            const double one = 1.0;
            double change = 0.0;
            if (directional_derivative(instance, &unknowns[i], 1, &knowns[j], 1, &one, &change) != OK) return FAILED;
            sensitivity[j] += seed[i] * change;
        }
    }
    return OK;
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[],
                                    size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity) {
    ENTER(c, READABLE, "fmi3GetAdjointDerivative");
    REQUIRE_POINTER(unknowns && seed, n_unknowns, "fmi3GetAdjointDerivative");
    REQUIRE_POINTER(knowns && sensitivity, n_knowns, "fmi3GetAdjointDerivative");
    REQUIRE_SIZE(n_unknowns, n_seed, "fmi3GetAdjointDerivative");
    REQUIRE_SIZE(n_knowns, n_sensitivity, "fmi3GetAdjointDerivative");
    return FMI(adjoint_derivative(instance, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity));
}

/* ---- model exchange -------------------------------------------------------------------------------------- */

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) {
    ENTER(c, INITIALIZATION | EVENT, "fmi3EvaluateDiscreteStates");
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *needs_update, fmi3Boolean *terminate_simulation,
                                    fmi3Boolean *nominals_changed, fmi3Boolean *states_changed,
                                    fmi3Boolean *has_next_event, fmi3Float64 *next_event) {
    ENTER(c, EVENT, "fmi3UpdateDiscreteStates");
    REQUIRE_POINTER(needs_update && terminate_simulation && nominals_changed && states_changed && has_next_event &&
                        next_event, 1, "fmi3UpdateDiscreteStates");
    const EventOutcome outcome = handle_events(instance);
    *needs_update = *terminate_simulation = *nominals_changed = false;
    *states_changed = outcome.states_jumped;
    *has_next_event = outcome.has_next_event;
    *next_event = outcome.has_next_event ? outcome.next_event : 0.0;
    return fmi3OK;
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 derivatives[], size_t n) {
    ENTER(c, INITIALIZED, "fmi3GetContinuousStateDerivatives");
    REQUIRE_POINTER(derivatives, n, "fmi3GetContinuousStateDerivatives");
    return FMI(get_derivatives(instance, derivatives, n));
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n) {
    ENTER(c, ANY_MODE, "fmi3GetNumberOfContinuousStates");
    REQUIRE_POINTER(n, 1, "fmi3GetNumberOfContinuousStates");
    *n = N_STATES;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n) {
    ENTER(c, ANY_MODE, "fmi3GetNumberOfEventIndicators");
    REQUIRE_POINTER(n, 1, "fmi3GetNumberOfEventIndicators");
    *n = 0;
    return fmi3OK;
}

/* ---- co-simulation --------------------------------------------------------------------------------------- */

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_state_set_before,
                      fmi3Boolean *event_handling_needed, fmi3Boolean *terminate_simulation,
                      fmi3Boolean *early_return, fmi3Float64 *last_successful_time) {
    ENTER(c, STEP, "fmi3DoStep");
    REQUIRE_POINTER(event_handling_needed && terminate_simulation && early_return && last_successful_time, 1,
                    "fmi3DoStep");
    (void)no_state_set_before;
    const Status status = do_step(instance, time, step);
    *event_handling_needed = *terminate_simulation = *early_return = false;
    *last_successful_time = instance->state.model.time;
    return FMI(status);
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference references[], size_t n,
                                    const fmi3Int32 orders[], fmi3Float64 values[], size_t n_values) {
    ENTER(c, INITIALIZED, "fmi3GetOutputDerivatives");
    REQUIRE_POINTER(references && orders && values, n, "fmi3GetOutputDerivatives");
    REQUIRE_SIZE(n, n_values, "fmi3GetOutputDerivatives");
    return FMI(get_output_derivatives(instance, references, n, orders, values));
}

/* ---- saved states ---------------------------------------------------------------------------------------- */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *handle) {
    ENTER(c, ANY_MODE, "fmi3GetFMUState");
    REQUIRE_POINTER(handle, 1, "fmi3GetFMUState");
    return FMI(save(instance, handle));
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState handle) {
    ENTER(c, ANY_MODE, "fmi3SetFMUState");
    REQUIRE_POINTER(handle, 1, "fmi3SetFMUState");
    return FMI(restore(instance, handle));
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *handle) {
    ENTER(c, ANY_MODE, "fmi3FreeFMUState");
    forget(instance, handle);
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState handle, size_t *size) {
    ENTER(c, ANY_MODE, "fmi3SerializedFMUStateSize");
    REQUIRE_POINTER(handle && size, 1, "fmi3SerializedFMUStateSize");
    *size = sizeof(Record);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState handle, fmi3Byte bytes[], size_t size) {
    ENTER(c, ANY_MODE, "fmi3SerializeFMUState");
    REQUIRE_POINTER(handle && bytes, 1, "fmi3SerializeFMUState");
    return FMI(write_bytes(instance, handle, bytes, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *handle) {
    ENTER(c, ANY_MODE, "fmi3DeserializeFMUState");
    REQUIRE_POINTER(bytes && handle, 1, "fmi3DeserializeFMUState");
    return FMI(read_bytes(instance, bytes, size, handle));
}
