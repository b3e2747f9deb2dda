/*
 * A co-simulation of a plant that follows what a controller's function block issues, cycle by cycle: no
 * interpreter within. The block is called with inputs that change at some cycles, until it stands after the
 * last change; then the loads are watched.
 */
#include <math.h>
#include <string.h>

#include "called_fmu.h"

#define NO_NUMBER (-1)                   /* a fault: beyond FARTHEST no machine's equations can be solved */
#define FARTHEST 1e9                     /* m (or rad) */

typedef int Play(void *block, const double *inputs, long cycles, double *outputs);

typedef struct {
    Play *play;
    void *instance;
    size_t n_inputs, n_outputs, n_axes;
    const size_t *axes;                  /* n_axes x 3: places of position, velocity and acceleration among outputs */
    size_t busy, promise, error, enabled; /* likewise */
    size_t size;                         /* of the instance in bytes */
} Block;

/* Of a cycle: what a sensor makes of its quantity of so many cycles ago, gain x value + added. */
typedef struct {
    double gain, added, age, valid;
} Measured;

typedef struct {
    double cycle;
    size_t n_rows;
    const long *start_cycles;                  /* cycle from which each row of inputs holds; the first is 0 */
    const double *inputs;                /* n_rows x n_inputs */
    const size_t *actual;                /* places of the axes' actual positions, which are given relative to the setpoint before */
    long longest;                        /* cycles after the last row within which the axes must stand */
    long settle, watch;                  /* cycles of standing before the loads' sway counts, and while it does */
    size_t n_parameters, n_setpoints, n_loads;
    const unsigned *parameter_references, *setpoint_references, *load_references;
    const double *parameters;
    double *setpoints;                   /* where axes stand that the block does not lead */
    const size_t *led;                   /* n_axes: places among the setpoints */
    size_t n_hoists;                     /* axes that follow an input of the block */
    const size_t *hoists, *columns;         /* their places among the setpoints, and of the inputs */
    const double *ratios;                /* of the axis's position to the input */
    size_t n_marks;
    const long *marks;                   /* rising cycles, before which the block's instance is copied */
    size_t n_sensors;
    const Measured *measured;            /* n_sensors of each cycle that there may be */
    const double *pushed;                /* of each of these and each axis: m, as if the air moved it by so much */
    const unsigned *quantities;          /* n_sensors: what they show */
    const size_t *shows, *valid;         /* n_sensors: places of two inputs */
    double *shown;                       /* as `measured`, to be written */
    long again;                          /* how often the axes may move on after they stood: the rest that lasts counts */
} History;

/* Of an axis; gap: by how far the position is not the velocity's integral, nor this the acceleration's. */
typedef struct {
    double velocity, acceleration, jerk, lowest, highest, gap, creep;
} Extremes;

typedef struct {
    Extremes *axes;                      /* n_axes */
    double *on_the_way, *residual;       /* n_loads: greatest sway at any time, and of what remains */
    double *trace;                       /* n_outputs + n_loads columns of n_rows cycles each, or null */
    char *copies;                        /* of the instance, as marked */
    long n_rows;
    long stands, cycles;                 /* stands: the cycle from which the axes do, or -1 */
    int status, fault, error;
    bool promise;                        /* at the end */
} Found;

static double greater(double peak, double value) { return isnan(value) ? HUGE_VAL : fmax(peak, fabs(value)); }

static void begin_axes(const Block *block, Found *found) {
    for (size_t i = 0; i < block->n_axes; i++) {
        found->axes[i] = (Extremes){.lowest = HUGE_VAL, .highest = -HUGE_VAL};
    }
}

/* What an axis does in this cycle, `now`, and did in the one before. */
static void take_axis(const size_t *places, const double *before, const double *now, double cycle, Extremes *axis) {
    const double position = now[places[0]], velocity = now[places[1]], acceleration = now[places[2]];
    axis->velocity = greater(axis->velocity, velocity);
    axis->acceleration = greater(axis->acceleration, acceleration);
    axis->lowest = isnan(position) ? -HUGE_VAL : fmin(axis->lowest, position);
    axis->highest = isnan(position) ? HUGE_VAL : fmax(axis->highest, position);
    if (before == NULL) return;
    const double change = acceleration - before[places[2]];
    const double half = 0.5 * cycle;
    axis->jerk = greater(axis->jerk, change / cycle);
    const double gain = velocity - before[places[1]] - half * (acceleration + before[places[2]]);
    const double way = position - before[places[0]] - half * (velocity + before[places[1]]);
    axis->gap = greater(axis->gap, gain * cycle);
    axis->gap = greater(axis->gap, way + cycle * cycle * change / 12.0);
}

static bool numbers(const Block *block, const double *outputs) {
    for (size_t i = 0; i < 3 * block->n_axes; i++) {
        if (!(fabs(outputs[block->axes[i]]) <= FARTHEST)) return false;
    }
    return true;
}

static bool standing(const Block *block, const double *outputs) {
    if (outputs[block->busy] != 0.0) return false;
    for (size_t i = 0; i < block->n_axes; i++) {
        if (outputs[block->axes[3 * i + 1]] != 0.0) return false;
    }
    return true;
}

static void take_states(const Block *block, const double *outputs, Found *found) {
    if (outputs[block->error] != 0.0) found->error = (int)outputs[block->error];
    found->promise = outputs[block->promise] != 0.0;
}

static void take_loads(const History *history, const double *sway, bool counts, Found *found) {
    for (size_t i = 0; i < history->n_loads; i++) {
        found->on_the_way[i] = greater(found->on_the_way[i], sway[i]);
        if (counts) found->residual[i] = greater(found->residual[i], sway[i]);
    }
}

/* What sensors tell in a cycle, of which the plant stands at the beginning. */
static int measure(const Fmu *fmu, const History *history, long k, double *inputs) {
    const long n = (long)history->n_sensors;
    const int status = get(fmu, history->quantities, history->n_sensors, history->shown + n * k);
    for (long i = 0; i < n; i++) {
        const Measured *now = history->measured + n * k + i;
        const long then = k - (long)now->age;
        inputs[history->shows[i]] = now->gain * history->shown[n * (then < 0 ? 0 : then) + i] + now->added;
        inputs[history->valid[i]] = now->valid;
    }
    return status;
}

/* Let the plant follow the setpoints for a cycle, its axes where the air seems to have them. */
static int follow(const Fmu *fmu, const Block *block, const History *history, long k, double *setpoints) {
    memcpy(setpoints, history->setpoints, history->n_setpoints * sizeof(double));
    for (size_t i = 0; history->n_sensors > 0 && i < block->n_axes; i++) {
        setpoints[history->led[i]] += history->pushed[k * (long)block->n_axes + (long)i];
    }
    const int status = set(fmu, history->setpoint_references, history->n_setpoints, setpoints);
    return status == GOOD ? step(fmu, (double)k * history->cycle, history->cycle) : status;
}

/* `room`: 2 x n_outputs + n_loads + n_axes + n_inputs + n_setpoints. */
EXPORT void block_run(const Fmu *fmu, const Block *block, const History *history, double *room, Found *found) {
    double *before = NULL, *now = room;
    double *sway = room + 2 * block->n_outputs, *stood = sway + history->n_loads, *inputs = stood + block->n_axes;
    double *setpoints = inputs + block->n_inputs;
    long last = history->start_cycles[history->n_rows - 1], end = last + history->longest;
    long again = history->n_sensors > 0 ? history->again : 0;
    size_t row = 0, mark = 0;
    bool promised = history->n_sensors == 0; /* since it stands: a sensor may tell only later that the load is calm */
    begin_axes(block, found);
    found->stands = -1;
    found->status = begin(fmu, 0.0, history->parameter_references, history->n_parameters, history->parameters);
    for (long k = 0; k < end && found->status == GOOD; k++, found->cycles = k) {
        while (row + 1 < history->n_rows && history->start_cycles[row + 1] <= k) row++;
        memcpy(inputs, history->inputs + row * block->n_inputs, block->n_inputs * sizeof(double));
        for (size_t i = 0; i < block->n_axes; i++) inputs[history->actual[i]] += history->setpoints[history->led[i]];
        if (history->n_sensors > 0 && measure(fmu, history, k, inputs) != GOOD) found->status = !GOOD;
        for (; mark < history->n_marks && history->marks[mark] == k; mark++) {
            memcpy(found->copies + mark * block->size, block->instance, block->size);
        }
        found->fault = block->play(block->instance, inputs, 1, now);
        if (found->fault == 0 && !numbers(block, now)) found->fault = NO_NUMBER;
        if (found->fault != 0) return;
        take_states(block, now, found);
        const bool guides = now[block->enabled] != 0.0;
        if (again > 0 && found->stands >= 0 && !standing(block, now)) {
            again--;
            found->stands = -1;
            end = last + history->longest;
            for (size_t i = 0; i < block->n_axes; i++) found->axes[i].creep = 0.0;
            memset(found->residual, 0, history->n_loads * sizeof(double));
        }
        if (k >= last && found->stands < 0 && standing(block, now)) {
            found->stands = k;
            end = k + history->settle + history->watch;
            promised = history->n_sensors == 0;
            for (size_t i = 0; i < block->n_axes; i++) stood[i] = now[block->axes[3 * i]];
        }
        for (size_t i = 0; i < block->n_axes; i++) {
            const double position = now[block->axes[3 * i]];
            if (guides) take_axis(block->axes + 3 * i, before, now, history->cycle, found->axes + i);
            if (found->stands >= 0) found->axes[i].creep = greater(found->axes[i].creep, position - stood[i]);
            history->setpoints[history->led[i]] = position;
        }
        for (size_t i = 0; i < history->n_hoists; i++) {
            history->setpoints[history->hoists[i]] = history->ratios[i] * inputs[history->columns[i]];
        }
        if (found->status == GOOD) found->status = follow(fmu, block, history, k, setpoints);
        if (found->status == GOOD) found->status = get(fmu, history->load_references, history->n_loads, sway);
        if (found->stands >= 0 && found->promise && !promised) {
            promised = true;
            memset(found->residual, 0, history->n_loads * sizeof(double));
        }
        take_loads(history, sway, found->stands >= 0 && k >= found->stands + history->settle, found);
        if (found->trace != NULL && k < found->n_rows) {
            double *kept = found->trace + k;
            for (size_t i = 0; i < block->n_outputs; i++, kept += found->n_rows) *kept = now[i];
            for (size_t i = 0; i < history->n_loads; i++, kept += found->n_rows) *kept = sway[i];
        }
        before = guides ? now : NULL;
        now = now == room ? room + block->n_outputs : room;
    }
}
