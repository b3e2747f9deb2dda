/* The functions that FMI 2.0.4 and 3.0 declare alike, but for the prefix of all names. */

/* ---- logging, life cycle --------------------------------------------------------------------------------- */

FmiStatus NAMED(SetDebugLogging)(FmiInstance c, FmiBoolean on, size_t n, const FmiString categories[]) {
    ENTER(c, ANY_MODE, PREFIX "SetDebugLogging");
    REQUIRE_POINTER(categories, n, PREFIX "SetDebugLogging");
    return FMI(set_logging(instance, on, n, categories));
}

void NAMED(FreeInstance)(FmiInstance c) {
    if (c) discard(c);
}

FmiStatus NAMED(ExitInitializationMode)(FmiInstance c) {
    ENTER(c, INITIALIZATION, PREFIX "ExitInitializationMode");
    return FMI(end_initialization(instance));
}

FmiStatus NAMED(Terminate)(FmiInstance c) {
    ENTER(c, EVENT | CONTINUOUS | STEP | STEP_FAILED, PREFIX "Terminate");
    return FMI(terminate(instance));
}

FmiStatus NAMED(Reset)(FmiInstance c) {
    ENTER(c, ANY_MODE, PREFIX "Reset");
    reset(instance);
    tell(instance, "Reset.");
    return FMI(OK);
}

/* ---- model exchange -------------------------------------------------------------------------------------- */

FmiStatus NAMED(EnterEventMode)(FmiInstance c) {
    ENTER(c, EVENT | CONTINUOUS, PREFIX "EnterEventMode");
    instance->state.mode = EVENT;
    return FMI(OK);
}

FmiStatus NAMED(EnterContinuousTimeMode)(FmiInstance c) {
    ENTER(c, EVENT, PREFIX "EnterContinuousTimeMode");
    instance->state.mode = CONTINUOUS;
    return FMI(OK);
}

FmiStatus NAMED(CompletedIntegratorStep)(FmiInstance c, FmiBoolean no_state_set_before, FmiBoolean *enter_event_mode,
                                         FmiBoolean *terminate_simulation) {
    ENTER(c, CONTINUOUS, PREFIX "CompletedIntegratorStep");
    REQUIRE_POINTER(enter_event_mode && terminate_simulation, 1, PREFIX "CompletedIntegratorStep");
    (void)no_state_set_before;
    *enter_event_mode = *terminate_simulation = 0;
    return FMI(complete_step(instance));
}

FmiStatus NAMED(SetTime)(FmiInstance c, double time) {
    ENTER(c, EVENT | CONTINUOUS, PREFIX "SetTime");
    return FMI(set_time(instance, time));
}

FmiStatus NAMED(SetContinuousStates)(FmiInstance c, const double states[], size_t n) {
    ENTER(c, CONTINUOUS, PREFIX "SetContinuousStates");
    REQUIRE_POINTER(states, n, PREFIX "SetContinuousStates");
    return FMI(set_states(instance, states, n));
}

FmiStatus NAMED(GetContinuousStates)(FmiInstance c, double states[], size_t n) {
    ENTER(c, INITIALIZED, PREFIX "GetContinuousStates");
    REQUIRE_POINTER(states, n, PREFIX "GetContinuousStates");
    return FMI(get_states(instance, states, n));
}

FmiStatus NAMED(GetNominalsOfContinuousStates)(FmiInstance c, double nominals[], size_t n) {
    ENTER(c, INITIALIZED, PREFIX "GetNominalsOfContinuousStates");
    REQUIRE_POINTER(nominals, n, PREFIX "GetNominalsOfContinuousStates");
    return FMI(get_nominals(instance, nominals, n));
}

FmiStatus NAMED(GetEventIndicators)(FmiInstance c, double indicators[], size_t n) {
    ENTER(c, INITIALIZED, PREFIX "GetEventIndicators");
    (void)indicators;
    return FMI(n == 0 ? OK : fail(instance, "There are no event indicators."));
}
