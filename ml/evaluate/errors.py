"""What can be wrong with an evaluation's data."""


class UnusableData(Exception):
    """The file cannot be evaluated; the message says what is wrong and what is expected."""
