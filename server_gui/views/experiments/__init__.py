"""A/B trials and sweeps in the window: what is to be tried, how it goes, and what came of it."""
