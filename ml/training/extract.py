"""Many sessions' decisions: one after the other here, or on a Dask cluster, with the same bits.

A worker that dies has its sessions done again by another one. What travels there is `Ask`, which has no key
in it: workers reach the store by their own environment (AWS_…).
"""

import asyncio
from collections.abc import Sequence

from ml.errors import UnusableData
from ml.progress import Tell, untold
from ml.training.dataset import Ask, LeftOut, SessionDecisions, part

PATIENCE_S = 30  # for a cluster to answer


def extract(asks: Sequence[Ask], cluster: str = "", told: Tell = untold) -> list[SessionDecisions | LeftOut]:
    """Return a result for each that is asked for, in this order; `cluster` is a Dask scheduler's address.

    `told` hears of each session that is read here.

    Raises:
        UnusableData: there is no Dask here, or the cluster does not answer, or gives up.
        StoreError, UnusableModel: as `part`.

    """
    if cluster:
        return _on(cluster, asks)
    found = []
    for at, ask in enumerate(asks):
        told("reading sessions", at, len(asks))
        found.append(part(ask))
    return found


def _on(cluster: str, asks: Sequence[Ask]) -> list[SessionDecisions | LeftOut]:
    try:
        from distributed import KilledWorker
    except ModuleNotFoundError as error:
        raise UnusableData("a cluster needs Dask: pip install 'gwrms[cluster]'") from error
    try:
        return asyncio.run(_gathered(cluster, asks))
    except KilledWorker as error:
        raise UnusableData(f"the cluster at {cluster} gave up: its workers died again and again") from error
    except OSError as error:
        raise UnusableData(f"no Dask scheduler answers at {cluster}: {error}") from error


async def _gathered(cluster: str, asks: Sequence[Ask]) -> list[SessionDecisions | LeftOut]:
    from distributed import Client

    # In a loop of our own: otherwise a client that finds nobody leaves its thread behind.
    made = Client(cluster, timeout=PATIENCE_S, set_as_default=False, asynchronous=True)  # type: ignore[no-untyped-call]
    async with made as client:
        # Not `pure`: the tables' rows are no part of what is asked.
        found: list[SessionDecisions | LeftOut] = await client.gather(client.map(part, asks, pure=False))
        return found
