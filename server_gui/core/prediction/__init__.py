"""Status prediction, live: every robot's rows → what its models say, how far to believe it, and rules on it.

settings     `[prediction]` and `[[rules]]` of the server's file
serving      a thread that looks which models serve, and loads them
following    one robot: its rows, windows, trust and rules
predicting   a thread that judges all robots together, and tells
rules        when a rule on predictions begins and ends to hold
news         what is told
state        how it goes
"""
