"""The fleet: every robot of the server's file, followed and recorded whole, without a screen.

A robot's feed tells events. Each goes to the recorder first (keeping), then is counted (statistics), said in
the log (saying), and handed to whoever shows it. `Fleet` holds the robots; `Collector` is the fleet with its
spool and store, and `door` is where a collector that runs is asked.
"""
