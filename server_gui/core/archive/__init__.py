"""Recorded sessions at the desk: found, played, labelled, and their journals."""
