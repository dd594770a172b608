"""Numerical methods that know Functions and numbers, never mechanisms."""

from mbs.solvers.integrate import integrate, integrate_events
from mbs.solvers.problem import EventMotion, Events, IntegrationEvent

__all__ = ["EventMotion", "Events", "IntegrationEvent", "integrate", "integrate_events"]
