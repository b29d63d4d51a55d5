"""The object dictionaries of a robot's devices, and what these hold: looked at, never written."""
