"""Numerical methods that know Functions and numbers, never mechanisms."""

from mbs.solvers.integrate import integrate

__all__ = ["integrate"]
