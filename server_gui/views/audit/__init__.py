"""The page Audit: who changed what, and whether the record holds."""
