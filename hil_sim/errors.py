"""What the simulator says when it cannot do what it was asked."""


class SimulatorError(Exception):
    """The simulator cannot start or go on; the message names what, where and what to do."""
