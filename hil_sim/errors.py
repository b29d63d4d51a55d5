"""Errors of the simulator."""


class SimulatorError(Exception):
    """The simulator cannot start or go on; the message names what, where and what to do."""
