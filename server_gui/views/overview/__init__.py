"""The page Overview: what is so now, in one glance."""
