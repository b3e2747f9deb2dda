/*
 * {{ file }}_linux.c: the planner of {{ file }}.c in a real-time loop, by which a Linux machine is a controller, from
 * gen-profile. Not a safety function: keep emergency stop and STO in hardware.
 *
 *     cc -std=c11 -O2 -o {{ name }} "{{ file }}_linux.c" -lm
 *     sudo ./{{ name }} [SECONDS]        until Ctrl-C or SIGTERM
 *
 * It is called every {{ cycle }} s. Other programs reach it in shared memory, /dev/shm/{{ name }}, which is laid out as `struct
 * image` below: one writes the inputs, a fieldbus's takes the setpoints, and "{{ file }}_opcua.py" serves both by OPC UA.
 * All that belongs to one cycle stands in one row. Only this user and his group may write it (UMask=0007 lets the
 * group): a file of that name that is another user's is refused. A program that opens it should do the same.
 *
 * Who commands must change bAlive, in any way, every SECONDS (1; 0 for never): while it does not, bStop is set. The
 * first signal sets bStop, too, and a second one bQuickStop; the program ends once the axis stands, and says how
 * punctual its cycles were.
 */
#define _GNU_SOURCE
#include "{{ file }}.c"

#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#if ATOMIC_LLONG_LOCK_FREE != 2
#error "numbers of 64 bits are not read and written whole here: take a 64-bit system"
#endif

enum { INPUTS = {{ inputs }}, COLUMNS = {{ columns }}, ROWS = 16384, NAME = 48, PRIORITY = 80 };
enum { ALIVE = 0, STOP = {{ stop }}, QUICK_STOP = {{ quick_stop }}, LATE = COLUMNS - 3, STEP, OVERRUNS };
static const int64_t SECOND = 1000000000, PERIOD = {{ period }}; /* ns */

struct image {
    char kind[16];
    int32_t inputs, columns, rows, process;
    double cycle_time;            /* s */
    _Atomic int64_t cycles;       /* rows so far: number n stands in place n % rows, until n + rows is written */
    _Atomic double given[INPUTS]; /* inputs, for others to write; truth values as 0 and 1 */
    double row[ROWS][COLUMNS];    /* of each cycle: inputs that were taken, outputs, s late, s of work, overruns */
    char names[COLUMNS][NAME];
};

static const char *const NAMES[COLUMNS] = {
{{ names }}
};
static const double FIRST[INPUTS] = {
{{ first }}
};

static volatile sig_atomic_t signals;

static void count_signal(int number)
{
    (void)number;
    ++signals;
}

static int64_t now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return time.tv_sec * SECOND + time.tv_nsec;
}

static void sleep_until(int64_t due)
{
    const struct timespec time = {.tv_sec = due / SECOND, .tv_nsec = due % SECOND};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, NULL) == EINTR) {
    }
}

static void give_up(const char *what)
{
    fprintf(stderr, "%s: %s.\n", what, strerror(errno));
    exit(1);
}

/* Refuse a file that another user may write: he would command the axes. */
static void require_own(int file)
{
    struct stat status;
    if (fstat(file, &status)) {
        give_up("/dev/shm/{{ name }}");
    }
    const mode_t foreign = S_IWOTH | (status.st_gid == getegid() ? 0 : S_IWGRP);
    if (!S_ISREG(status.st_mode) || status.st_uid != geteuid() || status.st_nlink != 1 || status.st_mode & foreign) {
        fputs("/dev/shm/{{ name }} is another user's, or others may write it: remove it, and start again.\n", stderr);
        exit(1);
    }
}

/* Share the image, and keep others that would drive the same axes out. */
static struct image *shared_image(void)
{
    const int file = shm_open("/{{ name }}", O_RDWR | O_CREAT, 0660);
    if (file < 0) {
        give_up("/dev/shm/{{ name }}");
    }
    require_own(file);
    if (flock(file, LOCK_EX | LOCK_NB)) {
        give_up("{{ name }} runs already; end that first");
    }
    struct image *image = MAP_FAILED;
    if (ftruncate(file, sizeof *image) == 0) {
        image = mmap(NULL, sizeof *image, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    }
    if (image == MAP_FAILED) {
        give_up("/dev/shm/{{ name }}");
    }
    memset(image, 0, sizeof *image); /* also of a program that was killed */
    image->inputs = INPUTS;
    image->columns = COLUMNS;
    image->rows = ROWS;
    image->process = getpid();
    image->cycle_time = {{ cycle }};
    for (int k = 0; k < COLUMNS; ++k) {
        strcpy(image->names[k], NAMES[k]);
    }
    for (int k = 0; k < INPUTS; ++k) {
        atomic_store(&image->given[k], FIRST[k]);
    }
    strcpy(image->kind, "gen-profile 1"); /* last: all the others are there */
    return image;
}

/* Ask for punctuality, as far as it is permitted. */
static void begin_real_time(void)
{
    const struct sched_param priority = {.sched_priority = PRIORITY};
    if (sched_setscheduler(0, SCHED_FIFO, &priority)) {
        fputs("Real-time priority is not permitted, so cycles may be late: start it as root, or with LimitRTPRIO=80 "
              "and CAP_SYS_NICE.\n", stderr);
    }
    if (mlockall(MCL_CURRENT | MCL_FUTURE)) {
        fputs("Memory cannot be locked, so cycles may be late: start it as root, or with CAP_IPC_LOCK.\n", stderr);
    }
}

static void take(const double *row, {{ name }}_inputs *in)
{
{{ taken }}
}

static void issue(const {{ name }}_outputs *out, double *row)
{
{{ issued }}
}

/* Call the planner in every cycle until a signal has stopped it; one that comes too late is left out. */
static void run(struct image *image, int64_t patience)
{
    static {{ name }}_state state;
    {{ name }}_inputs in;
    {{ name }}_outputs out = {0};
    double alive = 0.0, late = 0.0, latest = 0.0, longest = 0.0;
    int64_t cycles = 0, overruns = 0, due = now() + PERIOD, heard = due - patience;
    {{ name }}_init(&state, &in);
    for (; !signals || out.bBusy || cycles == 0; due += PERIOD) {
        for (; due < now(); due += PERIOD) {
            ++overruns;
        }
        sleep_until(due);
        const int64_t begun = now();
        double *row = image->row[cycles % ROWS];
        for (int k = 0; k < INPUTS; ++k) {
            row[k] = atomic_load(&image->given[k]);
        }
        if (row[ALIVE] < alive || row[ALIVE] > alive) {
            alive = row[ALIVE];
            heard = begun;
        }
        row[STOP] = row[STOP] > 0.0 || signals || (patience && begun - heard >= patience);
        row[QUICK_STOP] = row[QUICK_STOP] > 0.0 || signals > 1;
        take(row, &in);
        if ({{ name }}_step(&state, &in, &out)) {
            fputs("{{ name }} would have left an array: this is an error of gen-profile. Stop the axes.\n", stderr);
            exit(1);
        }
        issue(&out, row);
        row[LATE] = (begun - due) / 1e9;
        row[STEP] = (now() - begun) / 1e9;
        row[OVERRUNS] = overruns;
        late += row[LATE];
        latest = row[LATE] > latest ? row[LATE] : latest;
        longest = row[STEP] > longest ? row[STEP] : longest;
        atomic_store(&image->cycles, ++cycles);
    }
    printf("%lld cycles of %g ms: late by %.3g ms on average and %.3g ms at most, %.3g ms of work at most, "
           "%lld left out.\n", (long long)cycles, PERIOD / 1e6, 1e3 * late / cycles, 1e3 * latest, 1e3 * longest,
           (long long)overruns);
}

int main(int count, char **words)
{
    char *end = "";
    const double seconds = count > 1 ? strtod(words[1], &end) : 1.0;
    if (count > 2 || *end || !(seconds >= 0.0 && seconds < 1e6)) {
        fprintf(stderr, "usage: %s [SECONDS]: after so long without a change of bAlive it stops; 0 for never.\n", *words);
        return 2;
    }
    const struct sigaction counted = {.sa_handler = count_signal};
    sigaction(SIGTERM, &counted, NULL);
    sigaction(SIGINT, &counted, NULL);
    struct image *image = shared_image();
    begin_real_time();
    run(image, (int64_t)(seconds * 1e9));
    shm_unlink("/{{ name }}");
    return 0;
}
