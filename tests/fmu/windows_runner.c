/*
 * Runs an FMU of FMI 2.0 on Windows: rundll32 windows_runner.dll,run LIBRARY GUID STEPS FIRST COUNT RESULT
 * Steps of 10 ms; the values of COUNT reals from FIRST on after each one go to the file RESULT.
 */
#include <stdio.h>
#include <stdlib.h>
#include <windows.h>

#include "fmi2Functions.h"

static void ignore(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment, (void)name, (void)status, (void)category, (void)message;
}

#define FUNCTION(name) name##TYPE *name##_ = (name##TYPE *)(void *)GetProcAddress(library, #name)

__declspec(dllexport) void CALLBACK run(HWND window, HINSTANCE module, LPSTR command, int show) {
    char path[512], guid[64], result[512];
    int steps, first, count;
    (void)window, (void)module, (void)show;
    if (sscanf(command, "%511s %63s %d %d %d %511s", path, guid, &steps, &first, &count, result) != 6) return;
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
            fprintf(file, "%.17g ", value);
        }
        fprintf(file, "\n");
    }
    fmi2FreeInstance_(c);
    fclose(file);
}
