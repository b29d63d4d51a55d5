"""Measurements. Each module here has a `main()` that prints a table; nothing in it is a test."""
