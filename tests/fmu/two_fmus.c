/*
 * Runs two source FMUs, linked into this program under prefixed names, for 0.2 s: a plant with a push of 1 m/s^2, and
 * a system. Prints the plant's position and the system's setpoint. FMI is the version, 2 or 3; identities and value
 * references are defined on the command line.
 */
#include <stdio.h>
#include <stdlib.h>

#define JOINED_(a, b) a##b
#define JOINED(a, b) JOINED_(a, b)
#define OF_PLANT(name) JOINED(double_pendulum_crane_, name)
#define OF_SYSTEM(name) JOINED(paper_system_, name)

#if FMI == 2
#include "fmi2FunctionTypes.h"

static const fmi2CallbackFunctions CALLBACKS = {NULL, calloc, free, NULL, NULL};

#define RUN(OF, identity, input, output)                                                       \
    do {                                                                                       \
        extern fmi2InstantiateTYPE OF(fmi2Instantiate);                                        \
        extern fmi2SetupExperimentTYPE OF(fmi2SetupExperiment);                                \
        extern fmi2EnterInitializationModeTYPE OF(fmi2EnterInitializationMode);                \
        extern fmi2ExitInitializationModeTYPE OF(fmi2ExitInitializationMode);                  \
        extern fmi2SetRealTYPE OF(fmi2SetReal);                                                \
        extern fmi2GetRealTYPE OF(fmi2GetReal);                                                \
        extern fmi2DoStepTYPE OF(fmi2DoStep);                                                  \
        extern fmi2FreeInstanceTYPE OF(fmi2FreeInstance);                                      \
        const fmi2ValueReference in = input, out = output;                                     \
        const fmi2Real push = 1.0;                                                             \
        fmi2Component c = OF(fmi2Instantiate)("a", fmi2CoSimulation, identity, "", &CALLBACKS, 0, 0); \
        int bad = OF(fmi2SetupExperiment)(c, 0, 0.0, 0.0, 0, 0.0);                             \
        bad |= OF(fmi2EnterInitializationMode)(c) | OF(fmi2ExitInitializationMode)(c);         \
        if (input >= 0) bad |= OF(fmi2SetReal)(c, &in, 1, &push);                              \
        bad |= OF(fmi2DoStep)(c, 0.0, 0.1, 1) | OF(fmi2DoStep)(c, 0.1, 0.1, 1);                \
        bad |= OF(fmi2GetReal)(c, &out, 1, &value);                                            \
        OF(fmi2FreeInstance)(c);                                                               \
        if (bad) return EXIT_FAILURE;                                                          \
        printf("%.17g\n", value);                                                             \
    } while (0)
#else
#include "fmi3FunctionTypes.h"

#define RUN(OF, identity, input, output)                                                       \
    do {                                                                                       \
        extern fmi3InstantiateCoSimulationTYPE OF(fmi3InstantiateCoSimulation);                \
        extern fmi3EnterInitializationModeTYPE OF(fmi3EnterInitializationMode);                \
        extern fmi3ExitInitializationModeTYPE OF(fmi3ExitInitializationMode);                  \
        extern fmi3SetFloat64TYPE OF(fmi3SetFloat64);                                          \
        extern fmi3GetFloat64TYPE OF(fmi3GetFloat64);                                          \
        extern fmi3DoStepTYPE OF(fmi3DoStep);                                                  \
        extern fmi3FreeInstanceTYPE OF(fmi3FreeInstance);                                      \
        const fmi3ValueReference in = input, out = output;                                     \
        const fmi3Float64 push = 1.0;                                                          \
        fmi3Boolean a, b, d;                                                                   \
        fmi3Float64 last;                                                                      \
        fmi3Instance c = OF(fmi3InstantiateCoSimulation)("a", identity, "", 0, 0, 0, 0, NULL, 0, NULL, NULL, NULL); \
        int bad = OF(fmi3EnterInitializationMode)(c, 0, 0.0, 0.0, 0, 0.0);                     \
        bad |= OF(fmi3ExitInitializationMode)(c);                                              \
        if (input >= 0) bad |= OF(fmi3SetFloat64)(c, &in, 1, &push, 1);                        \
        bad |= OF(fmi3DoStep)(c, 0.0, 0.1, 1, &a, &b, &d, &last);                              \
        bad |= OF(fmi3DoStep)(c, 0.1, 0.1, 1, &a, &b, &d, &last);                              \
        bad |= OF(fmi3GetFloat64)(c, &out, 1, &value, 1);                                      \
        OF(fmi3FreeInstance)(c);                                                               \
        if (bad) return EXIT_FAILURE;                                                          \
        printf("%.17g\n", value);                                                             \
    } while (0)
#endif

int main(void) {
    double value = 0.0;
    RUN(OF_PLANT, PLANT_IDENTITY, PLANT_INPUTS, PLANT_Q_A);
    RUN(OF_SYSTEM, SYSTEM_IDENTITY, -1, SYSTEM_COMMAND);
    return EXIT_SUCCESS;
}
