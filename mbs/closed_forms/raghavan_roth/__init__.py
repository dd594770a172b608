"""The general chain of six joints, after Raghavan and Roth 1993: in numbers, and in expressions."""
