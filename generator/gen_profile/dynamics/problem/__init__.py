"""The optimal control problem of a spec: equations, sensitivities, limits and cost, derived by CasADi."""
