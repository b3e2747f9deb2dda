/* The plant's equations as CasADi writes them; every result is one column. */
#ifndef PLANT_EQUATIONS_H
#define PLANT_EQUATIONS_H

/* Arguments: q_u, dq_u, q_a, dq_a, input, parameters. The work arrays stay empty. */
typedef int Equation(const double **arguments, double **results, long long int *iw, double *w, int memory);

Equation plant_acceleration;  /* of the unactuated coordinates; the input is the axes' acceleration */
Equation plant_jump;          /* of the unactuated rates; the input is the jump of the axes' velocity */
Equation plant_outputs;       /* sway, height and angle of every load; no input is used */

#endif
