"""Methods side by side on the same machines, and over errors of parameters."""
