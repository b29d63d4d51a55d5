"""The store: versioned tables of everything recorded, in a folder or in S3-compatible object storage.

store = Store("s3://bucket/prefix")     # credentials only from the AWS environment or profile
store.append(TELEMETRY, …)              # once, however often it is repeated
store.dataset("telemetry/000")          # Arrow, for pyarrow and duckdb

Errors and URLs need no libraries: what does is imported when it is first asked for.
"""

import importlib
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

from ml.store.errors import NoSuchTable, StoreError, StoreRefused, StoreUnreachable, UnsafeStore

if TYPE_CHECKING:
    from ml.store.store import Store
    from ml.store.tables import TABLES, TELEMETRY, Table

__all__ = [
    "TABLES",
    "TELEMETRY",
    "NoSuchTable",
    "Store",
    "StoreError",
    "StoreRefused",
    "StoreUnreachable",
    "Table",
    "UnsafeStore",
]
_PLACES: Final = MappingProxyType(
    {"Store": "store", "TABLES": "tables", "TELEMETRY": "tables", "Table": "tables"}
)


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_PLACES[name]}"), name)
