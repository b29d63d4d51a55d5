"""A file a target: `fuzz(data)` lets only those errors pass that the code under test promises.

Each also has `TOKENS`, words of its language, and `MODULES`, the code that it is judged by.
"""
