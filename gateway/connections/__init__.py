"""Clients' connections: accepted, read, given turns, answered, and bounded."""
