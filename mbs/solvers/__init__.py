"""Numerical methods that know Functions and numbers, never mechanisms."""

from mbs.solvers.events import Event, EventMotion, Events
from mbs.solvers.integrate import integrate, integrate_events

__all__ = ["Event", "EventMotion", "Events", "integrate", "integrate_events"]
