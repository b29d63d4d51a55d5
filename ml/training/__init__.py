"""Training: recorded sessions and their labels → a model that is judged before it serves.

recorded.py   a session's rows, at a pinned version of their table, as arrays
truth.py      labels → what is so at each decision: a class, or the phase of each leg
dataset.py    a session → decisions with features and truth: a pure function, also for other computers
extract.py    many sessions, here or on a cluster
training_sessions.py   the sessions of a wish, and the versions of their tables
data_split.py   which sensors, and who is held out
judging.py    the new model against the one that serves
adapting.py   a wearer's own gait phase
beside.py     an adapted model beside the one that it comes from, stride by stride
training.py   all of it together
"""
