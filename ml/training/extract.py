"""Many sessions' decisions: one after the other here, or on a Dask cluster, with the same bits.

A worker that dies has its sessions done again by another one. What travels there is `Ask`, which has no key
in it: workers reach the store by their own environment (AWS_…).
"""

from collections.abc import Sequence

from ml.errors import UnusableData
from ml.training.dataset import Ask, LeftOut, Part, part

PATIENCE_S = 30  # for a cluster to answer


def extract(asks: Sequence[Ask], cluster: str = "") -> list[Part | LeftOut]:
    """A result for each that is asked for, in this order; `cluster` is a Dask scheduler's address.

    Raises:
        UnusableData: the cluster does not answer, or gives up.
        StoreError, UnusableModel: as `part`.

    """
    return _on(cluster, asks) if cluster else list(map(part, asks))


def _on(cluster: str, asks: Sequence[Ask]) -> list[Part | LeftOut]:
    from distributed import Client, KilledWorker

    try:
        with Client(cluster, timeout=PATIENCE_S, set_as_default=False) as client:  # type: ignore[no-untyped-call]
            # Not `pure`: the tables' rows are no part of what is asked.
            found: list[Part | LeftOut] = client.gather(client.map(part, asks, pure=False))
    except KilledWorker as error:
        raise UnusableData(f"the cluster at {cluster} gave up: its workers died again and again") from error
    except OSError as error:
        raise UnusableData(f"no Dask scheduler answers at {cluster}: {error}") from error
    return found
