"""Looking into the store and moving it: browsing, exports, transfer, verification. Qt-free.

spooled        what only this computer has yet
tabular, mcap  a session as CSV, Parquet, MCAP
transfer       copies of a store, or of parts of it
verify         whether everything is there
"""
