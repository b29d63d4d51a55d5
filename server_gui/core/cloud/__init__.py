"""Looking into the store and moving it: browsing, exports, transfer, verification. Qt-free.

spooled        what only this computer has yet
recordings     every session, of store and spool together, each row once
tabular, mcap  a session as CSV, Parquet, MCAP
transfer       copies of a store, or of parts of it
verify         whether everything is there
"""
