"""Closed forms: which one, as a Function, all branches at once, as text."""
