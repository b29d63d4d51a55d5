"""The page that commissions a robot."""
