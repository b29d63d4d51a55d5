"""Errors of training data and of model files."""


class UnusableData(Exception):
    """Nothing can be learned or judged from this; the message says what is wrong and what is expected."""


class UnusableModel(ValueError):
    """A model cannot be used here; the message says which, what is wrong with it, and what to do."""


class Overtaken(UnusableModel):
    """Another model serves by now than the one that it was to take the place of; the message says which."""
