"""Processes that the desk starts and ends: the simulated robot, its gateway, a collector."""
