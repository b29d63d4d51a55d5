"""What is wrong with a robot now, in one table of texts: for window, terminal and events alike. No Qt."""
