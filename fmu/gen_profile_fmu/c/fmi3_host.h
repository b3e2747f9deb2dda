/* Logging, as an importer of FMI 3.0 hands it over, and memory. */
#ifndef FMI3_HOST_H
#define FMI3_HOST_H

#include <stdlib.h>

#include "fmi3Functions.h"

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
