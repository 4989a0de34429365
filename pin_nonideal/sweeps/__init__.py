"""Parameter sweeps: many runs over a set of parameters, stored as the runs end."""
