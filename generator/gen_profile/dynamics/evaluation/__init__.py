"""A motion on the machines of a spec: simulation, scenarios, figures, spectrum."""
