"""The store: versioned tables of everything recorded, in a folder or in S3-compatible object storage.

store = Store("s3://bucket/prefix")     # credentials only from the AWS environment or profile
store.append(TELEMETRY, …)              # once, however often it is repeated
store.dataset("telemetry/000")          # Arrow, for pyarrow and duckdb
"""

from ml.store.errors import NoSuchTable, StoreError, StoreRefused, StoreUnreachable, UnsafeStore
from ml.store.store import Store, default_url
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
    "default_url",
]
