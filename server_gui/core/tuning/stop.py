"""What became of a STOP: sent, then confirmed by every drive, or NOT CONFIRMED. Silence is never success."""

import time
from dataclasses import dataclass, field
from enum import Enum

from gateway.wire.stop import Stopped


class StopState(Enum):
    """Where the latest STOP stands."""

    IDLE = "no stop was sent"
    SENT = "sent"
    CONFIRMED = "confirmed"
    NOT_CONFIRMED = "NOT CONFIRMED"


@dataclass(frozen=True, slots=True)
class Proof:
    """A drive's first state that is not enabled, and how long after the STOP it came; 0: it was so before."""

    after_ms: float
    state: str


@dataclass(slots=True)
class StopProgress:
    """One robot's latest STOP; a newer one counts, whatever an older one is answered with."""

    state: StopState = StopState.IDLE
    text: str = ""
    held: bool = False
    at_ns: int | None = None
    number: int = 0
    proofs: dict[str, Proof] = field(default_factory=dict)  # drive → what its state channel has shown

    def sent(self) -> int:
        """Note that a STOP has gone out, and return its number."""
        self.number += 1
        self.state, self.text, self.at_ns = StopState.SENT, "STOP sent …", time.monotonic_ns()
        return self.number

    def answered(self, number: int, stopped: Stopped) -> None:
        """What the drives said."""
        if number != self.number:
            return
        self.held = stopped.held
        outcomes = stopped.drives | {f"controller {name}": said for name, said in stopped.controllers.items()}
        missing = [f"{name} {said}" for name, said in outcomes.items() if said != "confirmed"]
        if missing or not stopped.drives:
            self._not_confirmed(", ".join(missing) or "no drive answered")
        else:
            self.state = StopState.CONFIRMED
            self.text = f"STOP confirmed by all {len(stopped.drives)} drives"

    def failed(self, number: int, reason: str) -> None:
        """Nobody answered: consider the robot not stopped."""
        if number == self.number:
            self._not_confirmed(reason)

    def was_reset(self, held: bool) -> None:
        """A held stop was ended, or not."""
        self.held = held
        if not held:
            self.state, self.text = StopState.IDLE, ""

    def _not_confirmed(self, why: str) -> None:
        self.state = StopState.NOT_CONFIRMED
        self.text = f"STOP NOT CONFIRMED: {why}. Use the hardware stop"
