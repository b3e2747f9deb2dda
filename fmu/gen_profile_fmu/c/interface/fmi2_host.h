/* FMI 2.0's names, and logging and memory as its importers hand them over. */
#ifndef FMI2_HOST_H
#define FMI2_HOST_H

#include "fmi2Functions.h"

#define NAMED(function) fmi2##function
#define PREFIX "fmi2"
#define FMI(status) ((fmi2Status)(status))
typedef fmi2Status FmiStatus;
typedef fmi2Component FmiInstance;
typedef fmi2Boolean FmiBoolean;
typedef fmi2String FmiString;

typedef struct {
    const fmi2CallbackFunctions *callbacks;
} Host;

/* Messages are complete texts without a percent sign: they are safe as the format string that FMI wants. */
static void host_log(const Host *host, const char *name, int status, const char *category, const char *text) {
    const fmi2CallbackFunctions *callbacks = host->callbacks;
    if (callbacks->logger) {
        callbacks->logger(callbacks->componentEnvironment, name, (fmi2Status)status, category, text);
    }
}

/* FMI 2.0 has no updates on the way of a step. */
static int host_takes_updates(const Host *host) {
    (void)host;
    return 0;
}

static void host_update(const Host *host, double time, int asking) { (void)host, (void)time, (void)asking; }

static void *host_allocate(const Host *host, size_t size) { return host->callbacks->allocateMemory(1, size); }

static void host_free(const Host *host, void *memory) { host->callbacks->freeMemory(memory); }

#endif
