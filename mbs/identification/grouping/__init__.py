"""Relations between the columns of a regressor, by rules and by rank."""
