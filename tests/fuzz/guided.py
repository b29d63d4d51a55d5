"""One target under atheris, in a process of its own: python -m tests.fuzz.guided TARGET [OPTIONS]."""

import random
import sys

import atheris

from tests.fuzz.catalogue import target
from tests.fuzz.mutations import at_bound

INSTRUMENTED = ["drivers", "eds", "gateway", "ml", "server_gui", "can.interfaces.slcan", "canopen", "tomllib"]

AT_BOUNDS = 1 / 2  # of all mutations of a text: digit by digit, 256 is rarely made of 0


def mutate(data: bytes, most_bytes: int, seed: int) -> bytes:
    """As libFuzzer does, but for numbers that are set to a bound at once."""
    choice = random.Random(seed)
    made = at_bound(choice, data) if data.isascii() and choice.random() < AT_BOUNDS else data
    if made != data and len(made) <= most_bytes:
        return made
    return bytes(atheris.Mutate(data, most_bytes))


def main() -> None:
    with atheris.instrument_imports(include=INSTRUMENTED):
        chosen = target(sys.argv[1])
    atheris.Setup([sys.argv[0], *sys.argv[2:]], chosen.fuzz, custom_mutator=mutate)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
