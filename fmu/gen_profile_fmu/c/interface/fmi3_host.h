/* FMI 3.0's names, logging as its importers hand it over, and memory. */
#ifndef FMI3_HOST_H
#define FMI3_HOST_H

#include <stdlib.h>

#include "fmi3Functions.h"

#define NAMED(function) fmi3##function
#define PREFIX "fmi3"
#define FMI(status) ((fmi3Status)(status))
typedef fmi3Status FmiStatus;
typedef fmi3Instance FmiInstance;
typedef fmi3Boolean FmiBoolean;
typedef fmi3String FmiString;

typedef struct {
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    fmi3IntermediateUpdateCallback update; /* null where none is wanted */
} Host;

static void host_log(const Host *host, const char *name, int status, const char *category, const char *text) {
    (void)name;
    if (host->log) host->log(host->environment, (fmi3Status)status, category, text);
}

static int host_takes_updates(const Host *host) { return host->update != NULL; }

/* Ask for inputs, or show outputs, on the way of a step; it never ends early. */
static void host_update(const Host *host, double time, int asking) {
    bool early_return = false;
    double early_return_time = time;
    host->update(host->environment, time, asking, !asking, !asking, false, &early_return, &early_return_time);
}

static void *host_allocate(const Host *host, size_t size) {
    (void)host;
    return calloc(1, size);
}

static void host_free(const Host *host, void *memory) {
    (void)host;
    free(memory);
}

#endif
