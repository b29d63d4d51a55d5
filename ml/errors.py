"""What can be wrong with data that is to be learned from."""


class UnusableData(Exception):
    """Nothing can be learned or judged from this; the message says what is wrong and what is expected."""
