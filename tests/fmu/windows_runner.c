/*
 * Runs an FMU of FMI 2.0 on Windows: rundll32 windows_runner.dll,run LIBRARY GUID STEPS FIRST COUNT RESULT
 * Steps of 10 ms; the values of COUNT reals from FIRST on after each one go to the file RESULT.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <windows.h>

#include "fmi2Functions.h"

static void ignore(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment, (void)name, (void)status, (void)category, (void)message;
}

#define FUNCTION(name) name##TYPE *name##_ = (name##TYPE *)(void *)GetProcAddress(library, #name)

__declspec(dllexport) void CALLBACK run(HWND window, HINSTANCE module, LPSTR command, int show) {
    (void)window, (void)module, (void)show;
    char *words[6] = {strtok(command, " ")};
    for (int k = 1; k < 6; k++) words[k] = strtok(NULL, " ");
    if (!words[5]) return;
    const char *path = words[0], *guid = words[1], *result = words[5];
    int steps = atoi(words[2]), first = atoi(words[3]), count = atoi(words[4]);
    FILE *file = fopen(result, "w");
    HMODULE library = LoadLibraryA(path);
    if (!file || !library) return;
    FUNCTION(fmi2Instantiate);
    FUNCTION(fmi2SetupExperiment);
    FUNCTION(fmi2EnterInitializationMode);
    FUNCTION(fmi2ExitInitializationMode);
    FUNCTION(fmi2DoStep);
    FUNCTION(fmi2GetReal);
    FUNCTION(fmi2FreeInstance);
    static const fmi2CallbackFunctions callbacks = {ignore, calloc, free, NULL, NULL};
    fmi2Component c = fmi2Instantiate_("wine", fmi2CoSimulation, guid, "", &callbacks, 0, 0);
    fmi2SetupExperiment_(c, 0, 0.0, 0.0, 0, 0.0);
    fmi2EnterInitializationMode_(c);
    fmi2ExitInitializationMode_(c);
    for (int k = 0; k < steps; k++) {
        if (fmi2DoStep_(c, k * 0.01, 0.01, 1) != fmi2OK) break;
        for (unsigned reference = (unsigned)first; reference < (unsigned)(first + count); reference++) {
            double value;
            if (fmi2GetReal_(c, &reference, 1, &value) != fmi2OK) break;
            char digits[64];
            fputs(_gcvt(value, 17, digits), file);
            fputs(" ", file);
        }
        fputs("\n", file);
    }
    fmi2FreeInstance_(c);
    fclose(file);
}
