"""Models as files: what they may hold, what is known of each, which one serves, and what served before."""
