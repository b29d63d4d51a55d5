"""What an edit of a robot's parameters did: gait cycles before and after it, compared. No Qt, no threads."""
