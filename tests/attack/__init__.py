"""Attacks on a robot under load: what they do to a stop, the guard, the heartbeat, others and memory."""
