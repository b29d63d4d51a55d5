"""Draws the pages of the reference from what they are about, so that they cannot go stale."""
