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
} Host;

static void host_log(const Host *host, const char *name, int status, const char *category, const char *text) {
    (void)name;
    if (host->log) host->log(host->environment, (fmi3Status)status, category, text);
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
