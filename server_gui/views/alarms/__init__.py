"""What is wrong and what happened: the line above the pages, the whole list, the events."""
