/*
 * Goes on from damaged serialized states, in one translation unit with an FMU's sources and under sanitizers.
 *
 * First every byte is altered in turn, and none may be taken for a state. Then what a checksum protects is altered
 * together with the checksum, as no accident does: what is taken for a state must be one to go on from.
 */
#include "fmu.c"

#include <stdio.h>
#include <stdlib.h>

static const fmi2CallbackFunctions CALLBACKS = {NULL, calloc, free, NULL, NULL};
enum { ATTACKS = 4000 };

static void require(int condition, const char *words, unsigned long place) {
    if (condition) return;
    printf("%s: %lu\n", words, place);
    exit(EXIT_FAILURE);
}

static unsigned long long random_state = 88172645463325252ULL;

/* Marsaglia's xorshift. */
static unsigned long long next_random(void) {
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    return random_state ^= random_state << 17;
}

static fmi2Component started(fmi2Type type) {
    fmi2Component c = fmi2Instantiate("a", type, MODEL_IDENTITY, "", &CALLBACKS, fmi2False, fmi2False);
    require(c != NULL, "not instantiated", 0);
    fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    fmi2EnterInitializationMode(c);
    require(fmi2ExitInitializationMode(c) == fmi2OK, "not initialised", 0);
    return c;
}

/* Ask for all that may be asked of an instance in its mode. */
static void use(fmi2Component c) {
    fmi2ValueReference all[N_VALUES];
    fmi2Real values[N_VALUES];
    fmi2EventInfo info;
    size_t n = 0;
    for (unsigned i = 0; i < N_VALUES; i++) {
        if (VARIABLES[i].type == REAL) all[n++] = i;
    }
    fmi2GetReal(c, all, n, values);
    const State *state = &((Instance *)c)->state;
    if (state->mode == EVENT) fmi2NewDiscreteStates(c, &info);
    if (state->mode == STEP) fmi2DoStep(c, state->model.time, 0.05, fmi2True);
    fmi2GetReal(c, all, n, values);
}

static int taken(fmi2Component c, const Record *record) {
    fmi2FMUstate state = NULL;
    if (fmi2DeSerializeFMUstate(c, (const fmi2Byte *)record, sizeof *record, &state) != fmi2OK) {
        fmi2Reset(c);
        return 0;
    }
    fmi2SetFMUstate(c, state);
    fmi2FreeFMUstate(c, &state);
    return 1;
}

static void attack(fmi2Component c, const Record *good) {
    unsigned long gone_on = 0;
    for (unsigned long i = 0; i < ATTACKS; i++) {
        Record bad = *good;
        unsigned char *bytes = (unsigned char *)&bad;
        const size_t place = offsetof(Record, state) + next_random() % sizeof bad.state;
        bytes[place] = (unsigned char)next_random();
        if (i % 3 == 0) memset(bytes + place / 4 * 4, (int)next_random(), 4);
        bad.checksum = checksum_of(&bad);
        if (!taken(c, &bad)) continue;
        use(c);
        gone_on++;
    }
    require(gone_on > ATTACKS / 10, "too few states were taken", gone_on);
}

int main(void) {
    const fmi2Type types[] = {fmi2CoSimulation, fmi2ModelExchange};
    for (int k = 0; k < 2; k++) {
        fmi2Component c = started(types[k]), other = started(types[k]);
        fmi2FMUstate state = NULL;
        Record good;
        use(c);
        require(fmi2GetFMUstate(c, &state) == fmi2OK, "not saved", 0);
        require(fmi2SerializeFMUstate(c, state, (fmi2Byte *)&good, sizeof good) == fmi2OK, "not serialized", 0);
        require(taken(other, &good), "a good state was refused", 0);
        for (size_t i = 0; i < sizeof good; i++) {
            Record bad = good;
            ((unsigned char *)&bad)[i] ^= (unsigned char)(1u << i % 8);
            require(!taken(other, &bad), "a damaged byte was taken", i);
        }
        attack(other, &good);
        /* an importer that hands the state itself over, in place of its address */
        require(fmi2FreeFMUstate(c, (fmi2FMUstate *)state) == fmi2OK, "a state in place of its address", 0);
        fmi2FreeFMUstate(c, &state);
        /* empty lists, of which the profile has some; a null pointer is as good a place as any */
        fmi2GetReal(c, NULL, 0, NULL);
        fmi2GetDirectionalDerivative(c, NULL, 0, NULL, 0, NULL, NULL);
        fmi2GetRealOutputDerivatives(c, NULL, 0, NULL, NULL);
        if (N_STATES == 0) {
            require(fmi2GetContinuousStates(c, NULL, 0) == fmi2OK, "no states", 0);
            require(fmi2GetNominalsOfContinuousStates(c, NULL, 0) == fmi2OK, "no nominals", 0);
            require(fmi2GetDerivatives(c, NULL, 0) == fmi2OK, "no derivatives", 0);
            if (types[k] == fmi2ModelExchange) {
                require(fmi2EnterContinuousTimeMode(c) == fmi2OK, "no continuous time", 0);
                require(fmi2SetContinuousStates(c, NULL, 0) == fmi2OK, "no states to set", 0);
            }
        }
        fmi2FreeInstance(c);
        fmi2FreeInstance(other);
    }
    return EXIT_SUCCESS;
}
