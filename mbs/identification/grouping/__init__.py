"""Linear dependence of regressor columns, by symbolic rules and by numeric rank."""
