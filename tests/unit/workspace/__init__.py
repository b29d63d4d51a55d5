"""Tests of the server's core and the terminal dashboard."""
