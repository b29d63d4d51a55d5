"""The doctor's observations, gathered once: nothing here judges, enables or moves."""
