"""Cloud: the store and how it is reached, what is in it, what waits for it, and work on it."""
