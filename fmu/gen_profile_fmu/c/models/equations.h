/* The plant's equations as CasADi writes them; every result is one column. */
#ifndef EQUATIONS_H
#define EQUATIONS_H

/* Arguments: q_u, dq_u, q_a, dq_a, input, parameters. The work arrays stay empty. */
typedef int Equation(const double **arguments, double **results, long long int *iw, double *w, int memory);

static Equation equations_acceleration;  /* of the unactuated coordinates; the input is the axes' acceleration */
static Equation equations_jump;          /* of the unactuated rates; the input is the jump of the axes' velocity */
static Equation equations_outputs;       /* of all loads; no input is used */
/* Changes of accelerations, and of outputs, for changes of all arguments, which follow the arguments. */
static Equation equations_tangent;

#endif
