"""The page Edits: what each change of a parameter did, and a trial in words."""
