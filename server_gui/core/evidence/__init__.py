"""Effect of an edit on the gait: cycles before and after it, compared. No Qt, no threads."""
