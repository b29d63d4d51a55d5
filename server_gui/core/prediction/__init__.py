"""Status prediction: every robot's rows → what its models say, how far to believe it, and rules on it.

settings     `[prediction]` and `[[rules]]` of the server's file
inbox        what feeds tell, on its way to the thread that predicts
looking      a thread that looks somewhere again and again
serving      looks which models serve, and loads them
comparing    what of predictions was right, as labels say
track_record that of the last days, from the store; tracking: looks whether there is more
following    one robot: its rows, windows, trust and rules; danger: what is foreseen of it, where that is on
rules        when a rule on predictions begins and ends to hold
predicting   the thread that judges all robots together, and tells
adaptation   what becomes of a wearer's own model, by the table of its states; adapting: what learns it
hindsight    where in the stride both legs were; lesson: one walk to learn from
news, state  what it tells; how it goes
live         robots that are followed for a terminal alone
replay       a recorded session, predicted again
rehearsal    a rule over recordings; rehearsals: which recordings there are for that
"""
