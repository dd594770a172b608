"""Constants of URDF that its reader and its writer share."""

UNLIMITED = 1e30
"""Magnitude from which a limit counts as infinite, in a format without infinity."""

GRAVITY = (0.0, 0.0, -9.81)
"""Gravity [m/s^2] that readers assume, because URDF cannot specify it."""

MOMENTS = {
    "ixx": (0, 0),
    "ixy": (0, 1),
    "ixz": (0, 2),
    "iyy": (1, 1),
    "iyz": (1, 2),
    "izz": (2, 2),
}
"""Names of the moments of inertia, and their row and column."""

REDUCTION = ("mechanicalReduction", "mechanical_reduction", "gear_ratio")
"""Elements of a transmission with its ratio. The first one is written."""

ROTOR = ("motorInertia", "rotorInertia", "rotor_inertia")
"""Elements of a transmission with the inertia of the rotor. The first one is written."""
