"""Frames that are slid along their axes: no model of a robot is dearer by it, Lagrange's hardly."""

import pytest
from support.random_trees import random_tree

import mbs
import mbs.models
from mbs.operations import count
from mbs.recursions import (
    articulated_body,
    composite_body,
    lagrange,
    newton_euler,
    newton_euler_derivatives,
)

RECURSIONS = (
    *(articulated_body, composite_body, lagrange),
    *(newton_euler, newton_euler_derivatives),
)
MODELS = {
    "inertia": mbs.models.inertia_matrix,
    "efforts": mbs.models.inverse_dynamics,
    "bias": mbs.models.bias,
    "gravity": mbs.models.gravity_effort,
    "composite": lambda s: mbs.models.direct_dynamics(s, "composite"),
    "articulated": lambda s: mbs.models.direct_dynamics(s, "articulated"),
    "lagrange": lambda s: mbs.models.lagrange(s, "renaud"),
    "derivatives": mbs.models.inverse_dynamics_derivatives,
}
ROBOTS = ("ur5", "tx90", "two_branch_tree", "stanford", "puma560", "panda", "kr6", "youbot")


def prices(assemble):
    system = assemble()
    return {name: count(build(system)).price for name, build in MODELS.items()}


def both(assemble, monkeypatch):
    """Prices with frames slid, and with frames where the description has them."""
    slid = prices(assemble)
    for module in RECURSIONS:
        monkeypatch.setattr(
            module, "shift_frames", lambda tree, poses, bodies, **_: (poses, bodies)
        )
    return slid, prices(assemble)


@pytest.mark.sweep
@pytest.mark.parametrize("robot", ROBOTS)
def test_no_model_of_a_robot_is_dearer(robot, monkeypatch):
    slid, plain = both(lambda: mbs.load(robot).assemble(), monkeypatch)
    most = {name: price for name, price in plain.items() if name != "lagrange"}
    assert {name: slid[name] for name, price in most.items() if slid[name] > price} == {}
    assert slid["lagrange"] <= 1.015 * plain["lagrange"]


@pytest.mark.parametrize("seed", [7, 71, 3, 12])
def test_models_of_trees_are_hardly_dearer(seed, monkeypatch):
    """A height that is passed on to a joint that has none may cost a little, and save a lot."""
    tree = random_tree(seed, n=3 + seed % 4, aligned=True).mechanism
    slid, plain = both(tree.assemble, monkeypatch)
    assert {name: price for name, price in slid.items() if price > 1.016 * plain[name]} == {}


@pytest.mark.parametrize(
    ("robot", "model", "bound"),
    [
        ("ur5", "inertia", "85/75"),
        ("ur5", "efforts", "165/135"),
        ("ur5", "composite", "299/236"),
        ("tx90", "inertia", "85/73"),
        ("tx90", "efforts", "170/136"),
        ("two_branch_tree", "articulated", "428/375"),
        ("stanford", "lagrange", "227/192"),
        ("puma560", "inertia", "91/81"),
    ],
)
def test_operations(robot, model, bound):
    found = count(MODELS[model](mbs.load(robot).assemble()))
    mul, add = (int(part) for part in bound.split("/"))
    assert (found.mul + found.div, found.add) <= (mul, add)
    assert found.add <= add
