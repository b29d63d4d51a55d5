"""`python -m tests.bench [NAME …] [--quick]`: run the named measurements, or all; some have a shorter run."""

import importlib
import pkgutil
import sys
from pathlib import Path


def main() -> int:
    """Exit code: 0, or 1 where a measurement says that its limits were not kept."""
    known = sorted(
        module.name for module in pkgutil.iter_modules([str(Path(__file__).parent)]) if module.name[0] != "_"
    )
    wanted = [word for word in sys.argv[1:] if word != "--quick"] or known
    unknown = [name for name in wanted if name not in known]
    if unknown:
        sys.stderr.write(f"there is no measurement {', '.join(unknown)}; there are: {', '.join(known)}\n")
        return 2
    results = [importlib.import_module(f"tests.bench.{name}").main() for name in wanted]
    return max((int(result or 0) for result in results), default=0)


if __name__ == "__main__":
    sys.exit(main())
