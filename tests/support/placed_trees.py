"""Random forests and loops whose joints are placed by any chain of steps, with symbols in them.

One description is built three times: with symbols, with numbers in their place, and in pinocchio
and MuJoCo, which know nothing of frames on common perpendiculars.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import mbs
from mbs.components import Body, Prismatic, Revolute, Spherical

KINDS = {"revolute": Revolute, "prismatic": Prismatic}


@dataclass(frozen=True)
class Placed:
    """A joint and the body behind it.

    Attributes:
        parent: number of the body before it, -1 for the world.
        kind: revolute or prismatic.
        axis: of the joint, three numbers.
        before, behind: steps from the parent's frame to the joint, and from it to the body:
            ("shift", (x, y, z)), ("x" | "y" | "z", angle) or ("matrix", rows); a scalar is a number
            or the name of a symbol with a factor and a constant, (name, factor, constant).
        inertial: mass, centre of mass, principal moments about it.
        fixed: whether a body without mass is welded before the joint.
    """

    parent: int
    kind: str
    axis: tuple
    before: tuple
    behind: tuple
    inertial: tuple
    fixed: bool = False


def scalar(value, numbers, symbols):
    """A scalar as the description says it, or as a number."""
    if not isinstance(value, tuple):
        return value
    name, factor, constant = value
    if symbols:
        return f"({constant!r}) + ({factor!r})*{name}"
    return constant + factor * numbers[name]


def at(point, steps, numbers, symbols):
    """The point behind these steps."""
    for what, value in steps:
        if what == "shift":
            point = point.at(*(scalar(x, numbers, symbols) for x in value))
        elif what == "matrix":
            point = point.at(rotation=value)
        else:
            point = point.at(rotation=(what, scalar(value, numbers, symbols)))
    return point


def transform(steps, numbers):
    """(4, 4) of the steps, in numpy."""
    T = np.eye(4)
    for what, value in steps:
        step = np.eye(4)
        if what == "shift":
            step[:3, 3] = [scalar(x, numbers, False) for x in value]
        elif what == "matrix":
            step[:3, :3] = value
        else:
            k = "xyz".index(what)
            i, j = (k + 1) % 3, (k + 2) % 3
            angle = scalar(value, numbers, False)
            step[i, i] = step[j, j] = np.cos(angle)
            step[j, i] = np.sin(angle)
            step[i, j] = -step[j, i]
        T = T @ step
    return T


def mechanism(tree, numbers, *, symbols, defaults=None, loops=()):
    """The mechanism of mbs, with symbols or with numbers in their place."""
    m = mbs.Mechanism("placed", gravity=(0.3, -0.4, -9.7), parameters=defaults if symbols else None)
    bodies = []
    for k, one in enumerate(tree):
        mass, com, moments = one.inertial
        body = m.add(Body(f"b{k}", mass=mass, com=com, inertia=moments))
        start = m.world if one.parent < 0 else bodies[one.parent]
        if one.fixed:
            between = m.add(Body(f"f{k}", mass=0))
            m.connect(at(start.at(), one.before[:1], numbers, symbols), between)
            point = at(between.at(), one.before[1:], numbers, symbols)
        else:
            point = at(start.at(), one.before, numbers, symbols)
        joint = KINDS[one.kind](f"j{k}", axis=one.axis)
        # the body's frame seen from the joint is what the steps say: the joint's frame from it
        m.connect(point, joint, joint_point(body, one.behind, numbers, symbols))
        bodies.append(body)
    for number, (a, steps_a, b, steps_b) in enumerate(loops):
        m.connect(
            at(bodies[a].at(), steps_a, numbers, symbols),
            Spherical(f"cut{number}"),
            at(bodies[b].at(), steps_b, numbers, symbols),
        )
    return m


def joint_point(body, behind, numbers, symbols):
    """Where the frame_b of the joint is on the body."""
    return at(body.at(), behind, numbers, symbols)


def pinocchio_model(pin, tree, numbers):
    """The same tree in pinocchio."""
    model = pin.Model()
    model.gravity.linear = np.array([0.3, -0.4, -9.7])
    inside = []  # of each body: its joint and its frame in the joint's
    for k, one in enumerate(tree):
        parent, here = (0, np.eye(4)) if one.parent < 0 else inside[one.parent]
        place = here @ transform(one.before, numbers)
        axis = np.array(one.axis) / np.linalg.norm(one.axis)
        kind = (
            pin.JointModelPrismaticUnaligned(axis)
            if one.kind == "prismatic"
            else pin.JointModelRevoluteUnaligned(axis)
        )
        number = model.addJoint(parent, kind, pin.SE3(place), f"j{k}")
        body = np.linalg.inv(transform(one.behind, numbers))
        mass, com, moments = one.inertial
        inertia = pin.Inertia(mass, np.array(com), np.diag(moments))
        model.appendBodyToJoint(number, inertia, pin.SE3(body))
        inside.append((number, body))
    return model, inside


def mujoco_text(tree, numbers):
    """The same tree as MJCF."""
    children = {k: [] for k in range(-1, len(tree))}
    for k, one in enumerate(tree):
        children[one.parent].append(k)

    def frame(T):
        w = quaternion(T[:3, :3])
        return 'pos="{:.17g} {:.17g} {:.17g}"'.format(*T[:3, 3]) + (
            ' quat="{:.17g} {:.17g} {:.17g} {:.17g}"'.format(*w)
        )

    def write(k):
        one = tree[k]
        mass, com, moments = one.inertial
        place = transform(one.before, numbers)
        body = np.linalg.inv(transform(one.behind, numbers))
        kind = "slide" if one.kind == "prismatic" else "hinge"
        axis = "{:.17g} {:.17g} {:.17g}".format(*one.axis)
        inner = "".join(write(child) for child in children[k])
        return (
            f'<body name="p{k}" {frame(place)}><joint name="j{k}" type="{kind}" axis="{axis}"/>'
            f'<inertial pos="0 0 0" mass="1e-12" diaginertia="1e-13 1e-13 1e-13"/>'
            f'<body name="b{k}" {frame(body)}>'
            f'<inertial pos="{com[0]!r} {com[1]!r} {com[2]!r}" mass="{mass!r}"'
            f' diaginertia="{moments[0]!r} {moments[1]!r} {moments[2]!r}"/>{inner}</body></body>'
        )

    bodies = "".join(write(k) for k in children[-1])
    return (
        '<mujoco><compiler angle="radian" boundmass="0" boundinertia="0"/>'
        '<option gravity="0.3 -0.4 -9.7"/>'
        f"<worldbody>{bodies}</worldbody></mujoco>"
    )


def quaternion(R):
    """w, x, y, z of a rotation, by its largest component."""
    squares = np.array(
        [
            1 + R[0, 0] + R[1, 1] + R[2, 2],
            1 + R[0, 0] - R[1, 1] - R[2, 2],
            1 - R[0, 0] + R[1, 1] - R[2, 2],
            1 - R[0, 0] - R[1, 1] + R[2, 2],
        ]
    )
    k = int(np.argmax(squares))
    s = 2 * np.sqrt(squares[k])
    rows = [
        [s / 4, (R[2, 1] - R[1, 2]) / s, (R[0, 2] - R[2, 0]) / s, (R[1, 0] - R[0, 1]) / s],
        [(R[2, 1] - R[1, 2]) / s, s / 4, (R[0, 1] + R[1, 0]) / s, (R[0, 2] + R[2, 0]) / s],
        [(R[0, 2] - R[2, 0]) / s, (R[0, 1] + R[1, 0]) / s, s / 4, (R[1, 2] + R[2, 1]) / s],
        [(R[1, 0] - R[0, 1]) / s, (R[0, 2] + R[2, 0]) / s, (R[1, 2] + R[2, 1]) / s, s / 4],
    ]
    return np.array(rows[k])
