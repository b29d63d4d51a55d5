"""`python -m tests.bench [NAME …] [--quick]`: run the named measurements, or all; some have a shorter run.

What follows the name of a single one belongs to it: `python -m tests.bench ab_trials --walks 8`.
"""

import importlib
import inspect
import itertools
import pkgutil
import sys
from pathlib import Path


def main() -> int:
    """Exit code: 0, or 1 where a measurement says that its limits were not kept."""
    known = sorted(
        module.name for module in pkgutil.iter_modules([str(Path(__file__).parent)]) if module.name[0] != "_"
    )
    words = [word for word in sys.argv[1:] if word != "--quick"]
    named = list(itertools.takewhile(lambda word: word[0] != "-", words))
    if len(named) < len(words) and len(named) != 1:
        sys.stderr.write(f"{words[len(named)]}: only a single measurement that is named first has options\n")
        return 2
    wanted = named or known
    unknown = [name for name in wanted if name not in known]
    if unknown:
        sys.stderr.write(f"there is no measurement {', '.join(unknown)}; there are: {', '.join(known)}\n")
        return 2
    mains = [importlib.import_module(f"tests.bench.{name}").main for name in wanted]
    options = words[len(named) :]
    if options and not inspect.signature(mains[0]).parameters:
        sys.stderr.write(f"{named[0]} takes no {options[0]}\n")
        return 2
    results = [main(options) if options else main() for main in mains]
    return max((int(result or 0) for result in results), default=0)


if __name__ == "__main__":
    sys.exit(main())
