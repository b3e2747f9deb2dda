/* The planner block that planner_model.c calls. */
#ifndef PLANNER_BLOCK_H
#define PLANNER_BLOCK_H

#define CHECKED
#include "{{ block }}.h"

typedef {{ block }} PlannerBlock;

#endif
