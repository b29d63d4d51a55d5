"""Training: recorded sessions and their labels → a model that is judged before it serves.

recorded.py   a session's rows at a pinned version of the tables, in numpy
truth.py      labels → what is so at each decision: a class, or the phase of each leg
"""
