"""How Hypothesis tries its examples here."""

from hypothesis import HealthCheck, settings


def test_a_computer_that_is_busy_with_others_fails_no_example() -> None:
    assert settings().deadline is None
    assert HealthCheck.too_slow in settings().suppress_health_check
