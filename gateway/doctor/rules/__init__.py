"""What the doctor knows to find, a file for each place where it looks."""
