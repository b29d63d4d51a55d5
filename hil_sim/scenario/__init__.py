"""Scenario files: what happens to a robot and when, what is expected of its gateway, and who runs them."""
