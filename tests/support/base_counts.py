"""Robots whose numbers of base parameters are known: frames as rows of tables."""

from __future__ import annotations

from dataclasses import replace

from casadi import DM, SX
from support.base_robots import HALF, row, system

UP, ALONG_Y, OBLIQUE, NONE = (0, 0, -9.81), (0, -9.81, 0), (3, -4, -7), (0, 0, 0)
LEVEL = UP


def _arm(alphas, ds, rs):
    return [
        row(j, alpha=a, d=d, r=r) for j, (a, d, r) in enumerate(zip(alphas, ds, rs, strict=True))
    ]


TX40 = _arm((0, -HALF, 0, HALF, -HALF, HALF), (0, 0, 0.225, 0, 0, 0), (0, 0, 0.035, 0.225, 0, 0))
UR10E = _arm(
    (0, HALF, 0, 0, HALF, -HALF), (0, 0, -0.6127, -0.5716, 0, 0), (0.18, 0, 0, 0.174, 0.12, 0.117)
)
LWR4 = _arm((0, HALF, -HALF, -HALF, HALF, HALF, -HALF), (0,) * 7, (0, 0, 0.4, 0, 0.39, 0, 0))
GENERAL_6R = _arm(
    (0, 0.7, -0.9, 1.1, 0.6, -0.8), (0, 0.2, 0.3, 0.1, 0.15, 0.25), (0.3, 0.1, 0.2, 0.4, 0.1, 0.2)
)
RRRP = [row(0), row(1, d=0.3), row(2, d=0.25), row(3, "prismatic")]
RRPR = [row(0), row(1, d=0.3), row(2, "prismatic", d=0.25), row(3)]
PPP = [
    row(0, "prismatic"),
    row(1, "prismatic", alpha=HALF, theta=HALF),
    row(2, "prismatic", alpha=HALF),
]
RPP = [row(0), row(1, "prismatic"), row(2, "prismatic", alpha=HALF)]
PRP = [row(0, "prismatic"), row(1), row(2, "prismatic", alpha=HALF)]
PLANAR = [row(0), row(1, d=0.4), row(2, d=0.3)]
CART_POLE = [row(0, "prismatic", alpha=HALF, theta=HALF), row(1, alpha=HALF)]
TWO_ARMS = [
    row(0),
    row(1, gamma=0.4, b=0.3, alpha=HALF, d=0.2),
    row(2, d=0.35),
    row(3, alpha=HALF, r=0.1),
    row(1, gamma=-0.4, b=0.3, alpha=HALF, d=0.2),
    row(5, d=0.35),
    row(6, alpha=HALF),
]
RP_BRANCH = [
    row(0),
    row(1, d=0.3),
    row(2, alpha=HALF, d=0.3),
    row(2, gamma=0.5, b=0.2, alpha=0.7, d=0.3),
    row(4, "prismatic", alpha=HALF, theta=0.7, d=0.3),
]
TWO_ROOTS = [row(0), row(1, alpha=HALF), row(0, "prismatic", b=0.4, alpha=HALF), row(3, d=0.3)]
ELBOW = row(1, d=0.3)
PARALLELOGRAM = [
    row(0, actuated=True),
    row(1, d=0.5, actuated=False),
    row(0, d=0.8, actuated=False),
    row(2, d=0.8, actuated=False),
    row(3, "fixed", d=0.5),
]


def parallelogram(gravity, rows=PARALLELOGRAM, **values):
    """A parallelogram on the base, assembled away from the configuration in which it is flat."""
    return system(
        "parallelogram",
        rows,
        gravity,
        loop=[{"cut": [4, 5], "joint": "revolute"}],
        guess={"q1": 1.0, "q2": -1.0, "q3": 1.0},
        **values,
    )


def under(robot, gravity):
    """The same system under another gravity."""
    tree = replace(robot.tree, gravity=SX(DM(gravity)))
    return replace(robot, tree=tree, _cache={})


OPEN = {
    "tx40": (TX40, UP, (36, 40, 52)),
    "ur10e": (UR10E, UP, (36, 40, 52)),
    "lwr4": (LWR4, UP, (43, 48, 62)),
    "general_6r": (GENERAL_6R, UP, (36, 41, 53)),
    "general_6r_oblique": (GENERAL_6R, OBLIQUE, (38, 43, 55)),
    "tx40_oblique": (TX40, OBLIQUE, (38, 42, 54)),
    "tx40_weightless": (TX40, NONE, (34, 38, 50)),
    "rrrp": (RRRP, UP, (8, 11, 19)),
    "rrpr": (RRPR, UP, (8, 11, 19)),
    "ppp": (PPP, UP, (3, 4, 10)),
    "ppp_oblique": (PPP, OBLIQUE, (3, 6, 12)),
    "ppp_weightless": (PPP, NONE, (3, 3, 9)),
    "rpp": (RPP, UP, (5, 7, 13)),
    "rrrp_oblique": (RRRP, OBLIQUE, (10, 13, 21)),
    "rrrp_weightless": (RRRP, NONE, (8, 10, 18)),
    "prp": (PRP, UP, (5, 7, 13)),
    "planar_2r": (PLANAR[:2], ALONG_Y, (6, 7, 11)),
    "planar_2r_level": (PLANAR[:2], LEVEL, (4, 5, 9)),
    "planar_3r": (PLANAR, ALONG_Y, (9, 11, 17)),
    "two_arms": (TWO_ARMS, UP, (43, 47, 61)),
    "rp_branch": (RP_BRANCH, UP, (22, 25, 35)),
    "cart_pole": (CART_POLE, UP, (4, 4, 8)),
    "hoist_pole": ([row(0, "prismatic"), row(1, alpha=HALF)], UP, (4, 5, 9)),
    "slider_level": (CART_POLE[:1], UP, (1, 1, 3)),
    "slider_upright": ([row(0, "prismatic")], UP, (1, 2, 4)),
    "turntable": ([row(0)], UP, (1, 1, 3)),
    "pendulum": ([row(0)], ALONG_Y, (3, 3, 5)),
}
"""Rows, gravity, and counts of inertial parameters, then with rotors, then with friction too."""

CATALOGUE = {
    "puma560": (None, (36, 40, 52)),
    "puma560_oblique": (OBLIQUE, (38, 42, 54)),
    "puma560_weightless": (NONE, (34, 38, 50)),
    "rx90": (None, (36, 40, 52)),
    "stanford": (None, (33, 37, 49)),
    "stanford_oblique": (OBLIQUE, (35, 39, 51)),
    "stanford_weightless": (NONE, (31, 35, 47)),
    "scara": (None, (8, 11, 19)),
    "panda": (None, (43, 48, 62)),
}
"""Robots of the catalogue, gravity if not their own, and the same counts."""
