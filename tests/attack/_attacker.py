"""The attacker, a process: `python -m tests.attack._attacker NAME PORT SECONDS`; prints what it was told.

It has what the others leave of the processor: a real one has a computer of its own.
"""

import json
import os
import sys
from dataclasses import asdict

from tests.attack.attack import Strike
from tests.attack.barrage import Target
from tests.attack.table import ATTACKS

NICE = 15


def main() -> None:
    name, port, seconds = sys.argv[1:]
    os.setpriority(os.PRIO_PROCESS, 0, NICE)
    attack = ATTACKS[name]
    if not isinstance(attack, Strike):
        raise SystemExit(f"{name} is no attack by clients")
    said = attack.run(Target(("127.0.0.1", int(port)), float(seconds)))
    sys.stdout.write(json.dumps(asdict(said)) + "\n")


if __name__ == "__main__":
    main()
