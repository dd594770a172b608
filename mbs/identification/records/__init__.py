"""Measured motions, what they may not be, and their filters."""
