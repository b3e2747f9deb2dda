/*
 * Functions of an FMU, of FMI 2 or 3, for loops that call one instance without an interpreter between.
 */
#ifndef CALLED_FMU_H
#define CALLED_FMU_H

#include <stdbool.h>
#include <stddef.h>

#include "fmi2FunctionTypes.h"
#include "fmi3FunctionTypes.h"

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { GOOD = 0 };

/* Functions of one version; those of the other stay null. */
typedef struct {
    fmi2ResetTYPE *reset2;
    fmi2SetupExperimentTYPE *setup2;
    fmi2EnterInitializationModeTYPE *enter2;
    fmi2ExitInitializationModeTYPE *exit2;
    fmi2SetRealTYPE *set2;
    fmi2GetRealTYPE *get2;
    fmi2DoStepTYPE *step2;
    fmi3ResetTYPE *reset3;
    fmi3EnterInitializationModeTYPE *enter3;
    fmi3ExitInitializationModeTYPE *exit3;
    fmi3SetFloat64TYPE *set3;
    fmi3GetFloat64TYPE *get3;
    fmi3DoStepTYPE *step3;
    void *instance;
} Fmu;

static int set(const Fmu *fmu, const unsigned *references, size_t n, const double *values) {
    if (n == 0) return GOOD;
    return fmu->set2 ? (int)fmu->set2(fmu->instance, references, n, values)
                     : (int)fmu->set3(fmu->instance, references, n, values, n);
}

static int get(const Fmu *fmu, const unsigned *references, size_t n, double *values) {
    return fmu->get2 ? (int)fmu->get2(fmu->instance, references, n, values)
                     : (int)fmu->get3(fmu->instance, references, n, values, n);
}

static int step(const Fmu *fmu, double time, double size) {
    if (fmu->step2) return (int)fmu->step2(fmu->instance, time, size, fmi2True);
    bool event, terminate, early;
    double reached;
    return (int)fmu->step3(fmu->instance, time, size, true, &event, &terminate, &early, &reached);
}

/* Start anew at a time, with parameters. */
static int begin(const Fmu *fmu, double start, const unsigned *references, size_t n, const double *values) {
    if (fmu->reset2) {
        return fmu->reset2(fmu->instance) || fmu->setup2(fmu->instance, fmi2False, 0.0, start, fmi2False, 0.0) ||
               set(fmu, references, n, values) || fmu->enter2(fmu->instance) || fmu->exit2(fmu->instance);
    }
    return fmu->reset3(fmu->instance) || set(fmu, references, n, values) ||
           fmu->enter3(fmu->instance, false, 0.0, start, false, 0.0) || fmu->exit3(fmu->instance);
}

#endif
