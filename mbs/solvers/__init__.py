"""Numerical methods that know Functions and numbers, never mechanisms."""

from mbs.solvers.integrate import integrate, integrate_events
from mbs.solvers.problem import Event, EventMotion, Events

__all__ = ["Event", "EventMotion", "Events", "integrate", "integrate_events"]
