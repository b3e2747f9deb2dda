/*
 * Functions of an FMU, of FMI 2, for loops that call one instance without an interpreter between.
 */
#ifndef CALLED_FMU_H
#define CALLED_FMU_H

#include <stdbool.h>
#include <stddef.h>

#include "fmi2FunctionTypes.h"

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { GOOD = 0 };

typedef struct {
    fmi2ResetTYPE *reset;
    fmi2SetupExperimentTYPE *setup;
    fmi2EnterInitializationModeTYPE *enter;
    fmi2ExitInitializationModeTYPE *exit;
    fmi2SetRealTYPE *set;
    fmi2GetRealTYPE *get;
    fmi2DoStepTYPE *step;
    void *instance;
} Fmu;

static int set(const Fmu *fmu, const unsigned *references, size_t n, const double *values) {
    return n == 0 ? GOOD : (int)fmu->set(fmu->instance, references, n, values);
}

static int get(const Fmu *fmu, const unsigned *references, size_t n, double *values) {
    return (int)fmu->get(fmu->instance, references, n, values);
}

static int step(const Fmu *fmu, double time, double size) {
    return (int)fmu->step(fmu->instance, time, size, fmi2True);
}

/* Start anew at a time, with parameters. */
static int begin(const Fmu *fmu, double start, const unsigned *references, size_t n, const double *values) {
    return fmu->reset(fmu->instance) || fmu->setup(fmu->instance, fmi2False, 0.0, start, fmi2False, 0.0) ||
           set(fmu, references, n, values) || fmu->enter(fmu->instance) || fmu->exit(fmu->instance);
}

#endif
