"""Operations of the models of published robots: bounds that a change may only lower."""

import pytest
from count_operations import MODELS
from symbolic_robots import ROBOTS, symbolic_robot

from mbs.operations import count

BOUNDS = {
    "general_6r": ["391/327", "332/273", "381/312", "804/656", "136/78", "138/75"],
    "puma560": ["244/230", "137/133", "229/205", "457/409", "48/23", "32/13"],
    "rx90": ["232/217", "115/109", "219/196", "425/376", "44/19", "28/9"],
    "iiwa": ["276/262", "141/131", "268/246", "535/484", "68/31", "68/29"],
    "stanford": ["212/204", "86/89", "200/184", "377/343", "43/18", "26/8"],
    "sr400_tree": ["330/310", "154/156", "301/264", "562/503", "8/2", "6/1"],
}
"""Multiplications, divisions among them, and additions; symbols for lengths and inertias."""


@pytest.mark.sweep
@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("inertia", ["full", "base"])
def test_models_take_no_more_operations(robot, inertia):
    system = symbolic_robot(robot, inertia).assemble()
    for (name, build), bound in zip(MODELS.items(), BOUNDS[robot], strict=True):
        found = count(build(system))
        mul, add = (int(part) for part in bound.split("/"))
        assert found.mul + found.div <= mul, name
        assert found.add <= add, name
