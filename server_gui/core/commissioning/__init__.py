"""Commissioning a robot from the window: the command that does it, what it says and asks, and how it is."""
