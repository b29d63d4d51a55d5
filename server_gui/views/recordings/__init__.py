"""Recordings: which there are, one played back in the same views as a robot, spans of it labelled."""
