"""Constants of SDFormat that its reader and its writer share."""

from mbs.formats.urdf.shared import GRAVITY

MODEL_GRAVITY = GRAVITY
"""Gravity [m/s^2] that readers assume for a model without a world, as in URDF."""

ROTOR_INERTIA = "drake:rotor_inertia"
"""Element of a joint with the inertia of its rotor, in the namespace of Drake."""
