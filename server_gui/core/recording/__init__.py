"""Recording: everything that robots send is kept, first on this disk, then in the store.

recorder (its own thread) → spool (SQLite segments, durable) → uploader (its own thread) → ml.store
"""
