"""The doctor's rules, a file for each source of observations."""
