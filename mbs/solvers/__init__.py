"""Numerical methods on CasADi Functions and arrays, independent of mechanisms."""

from mbs.solvers._integrate import integrate, integrate_events
from mbs.solvers.problem import EventMotion, Events, IntegrationEvent

__all__ = ["EventMotion", "Events", "IntegrationEvent", "integrate", "integrate_events"]
