"""One target under atheris, in a process of its own: python -m tests.fuzz.guided TARGET [OPTIONS]."""

import sys

import atheris

from tests.fuzz.catalogue import target

INSTRUMENTED = ["drivers", "eds", "gateway", "ml", "server_gui", "can.interfaces.slcan", "canopen", "tomllib"]


def main() -> None:
    with atheris.instrument_imports(include=INSTRUMENTED):
        chosen = target(sys.argv[1])
    atheris.Setup([sys.argv[0], *sys.argv[2:]], chosen.fuzz)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
