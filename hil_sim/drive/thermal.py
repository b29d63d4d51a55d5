"""Heat in the motor: the winding above its housing (that is I²t), and the housing above the room."""

AMBIENT_C = 25.0
WINDING_RISE_C = 20.0  # winding over housing, after a long time at rated current
HOUSING_RISE_C = 35.0  # housing over room, likewise

_FULL_PEAK_UNTIL = 0.9  # of the load; from here to 1 the current folds back to the rated one


class Thermal:
    """`housing_c` is where the sensor sits; `load` is the winding's share of what it may bear for ever."""

    def __init__(self) -> None:
        self.housing_c = AMBIENT_C
        self.load = 0.0

    @property
    def winding_c(self) -> float:
        return self.housing_c + WINDING_RISE_C * self.load

    @property
    def peak_share(self) -> float:
        """Allowed share of the current above the rated one (0 … 1)."""
        return min(max((1.0 - self.load) / (1.0 - _FULL_PEAK_UNTIL), 0.0), 1.0)

    @property
    def reduced(self) -> bool:
        """Whether it is less than all of it."""
        return self.load > _FULL_PEAK_UNTIL

    def advance(self, current: float, elapsed_s: float, winding_time_s: float, housing_time_s: float) -> None:
        """Let `current` (share of the rated one) heat the motor for `elapsed_s`."""
        power = current * current
        self.load += (power - self.load) * elapsed_s / winding_time_s
        end_c = AMBIENT_C + HOUSING_RISE_C * power
        self.housing_c += (end_c - self.housing_c) * elapsed_s / housing_time_s
