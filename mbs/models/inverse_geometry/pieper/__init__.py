"""Pieper's method: arms with three axes through one point, or with three joints that slide."""

from mbs.models.inverse_geometry.pieper.method import pieper

__all__ = ["pieper"]
