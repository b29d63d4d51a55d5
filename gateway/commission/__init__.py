"""A robot's file found out on the bench: questions, what the answers and the bus say, and what is written."""
