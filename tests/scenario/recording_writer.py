"""`python -m tests.scenario.recording_writer URL NAME COMMITS`: one of several servers that share a store."""

import sys

from ml.store import Store
from ml.store.tables import EVENTS


def main() -> int:
    """Append a row a commit, and each row names its writer and its number."""
    url, name, commits = sys.argv[1], sys.argv[2], int(sys.argv[3])
    store = Store(url)
    for number in range(1, commits + 1):
        data = EVENTS.rows([{"robot": name, "kind": "marker", "number": number}])
        store.append(EVENTS, "events", data.schema, data.to_reader, name, number)
    return 0


if __name__ == "__main__":
    sys.exit(main())
