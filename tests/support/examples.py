"""How many examples a test tries that needs more or fewer than the others: a share by day, all by night."""

from hypothesis import settings

ALL = 100  # what Hypothesis tries by itself


def examples(by_night: int) -> int:
    """As many by night, and by day the share that the profile gives (see tests/conftest.py)."""
    return max(1, by_night * settings().max_examples // ALL)
