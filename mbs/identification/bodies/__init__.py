"""Full sets of parameters that bodies can have."""
