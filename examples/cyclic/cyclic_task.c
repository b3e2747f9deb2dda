/* A cyclic task of the shape that masters of EtherCAT have (IgH's, SOEM): process data in, one step, process data out, at
   absolute instants with real-time priority where that is allowed. A simulated slave stands for the bus: a CiA 402 drive in
   csp, with controlword, statusword, target and actual position. It was not run on a bus. */
#define _GNU_SOURCE
#include "crane.h"

#include <math.h>
#include <sched.h>
#include <stdio.h>
#include <sys/mman.h>
#include <time.h>

enum { CYCLES = 600, PERIOD = 10000000 /* ns */ };
static const double COUNTS = 1e6; /* of the drive, to a metre */

struct process_data {
    uint16_t controlword, statusword;
    int32_t target, actual;
};

static void exchange(struct process_data *data) /* ecrt_master_receive and _send, or ec_send and _receive_processdata */
{
    static int enabled_for = 0;
    switch (data->controlword & 0x0F) {
    case 0x06: data->statusword = 0x0231; break;
    case 0x07: data->statusword = 0x0233; break;
    case 0x0F: data->statusword = ++enabled_for > 3 ? 0x1237 : 0x0233; break; /* a brake takes its time */
    default: data->statusword = 0x0250; break;
    }
    if (data->statusword == 0x1237) {
        data->actual = data->target;
    }
}

static uint16_t next_controlword(uint16_t statusword) /* CiA 402-2, on the way to operation enabled */
{
    switch (statusword & 0x6F) {
    case 0x21: return 0x07;
    case 0x23:
    case 0x27: return 0x0F;
    default: return 0x06;
    }
}

int main(void)
{
    static crane_state state;
    crane_inputs in;
    crane_outputs out;
    struct process_data data = {.actual = 200000, .target = 200000};
    struct sched_param priority = {.sched_priority = 80};
    struct timespec due;
    long latest = 0;
    int ready = 0, real_time = !sched_setscheduler(0, SCHED_FIFO, &priority) && !mlockall(MCL_CURRENT | MCL_FUTURE);

    crane_init(&state, &in);
    clock_gettime(CLOCK_MONOTONIC, &due);
    for (int cycle = 0; cycle < CYCLES; ++cycle) {
        struct timespec now;
        due.tv_nsec += PERIOD;
        due.tv_sec += due.tv_nsec / 1000000000;
        due.tv_nsec %= 1000000000;
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL)) {
        }
        clock_gettime(CLOCK_MONOTONIC, &now);
        long late = (now.tv_sec - due.tv_sec) * 1000000000L + now.tv_nsec - due.tv_nsec;
        latest = late > latest ? late : latest;

        exchange(&data);
        int follows = (data.statusword & 0x126F) == 0x1227; /* operation enabled, bit 12: csp takes the target */
        double target = cycle < 250 ? 0.7 : 0.4;
        if (!follows) {
            in.fActPosition = data.actual / COUNTS; /* where the axis is taken over */
            data.target = data.actual;
        }
        in.bEnable = follows;
        in.bExecute = ready && target == in.fTarget; /* rises in the cycle after the target changed */
        in.fTarget = target;
        if (crane_step(&state, &in, &out) || out.bError) {
            return 1;
        }
        ready = ready || (out.bEnabled && !out.bBusy);
        if (out.bEnabled) {
            data.target = (int32_t)lround(COUNTS * out.fPosition);
        }
        data.controlword = next_controlword(data.statusword);
        printf("%d\n", (int)data.target);
    }
    fprintf(stderr, "%.3f ms late at most, %s real-time priority\n", 1e-6 * (double)latest, real_time ? "with" : "without");
    return 0;
}
