"""The first minutes: a splash until the simulated robot walks, what can be done with it, and a tour."""
