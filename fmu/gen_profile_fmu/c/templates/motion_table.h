/* A motion's knots in s; coefficients of its positions, lowest power first, by segment, power and axis. */
#ifndef MOTION_TABLE_H
#define MOTION_TABLE_H

enum { N_SEGMENTS = {{ segments }}, N_POWERS = {{ powers }} };

static const double KNOTS[N_SEGMENTS + 1] = {{ knots }};

static const double TARGET[] = {{ target }};

static const double FINAL_VELOCITY[] = {{ final_velocity }};

static const double COEFFICIENTS[N_SEGMENTS][N_POWERS][{{ axes }}] = {
{{ rows }}
};

#endif
