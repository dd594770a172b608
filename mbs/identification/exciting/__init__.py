"""Motions that show the parameters as well as the limits of a robot allow."""
