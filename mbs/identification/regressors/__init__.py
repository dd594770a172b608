"""Models that are linear in the dynamic parameters, and the parameters as named columns."""
