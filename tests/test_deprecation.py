"""Old public names work with a DeprecationWarning that gives the present name."""

import importlib

import pytest

import mbs

RENAMED = {
    "mbs.components.Mechanism": "mbs.Mechanism",
    "mbs.components.Placed": "mbs.components.SubMechanism",
    "mbs.components.Attraction": "mbs.components.PointGravity",
    "mbs.components.Note": "mbs.components.ImportNote",
    "mbs.loops.examine": "mbs.loops.configuration_report",
    "mbs.loops.ConfigurationState": "mbs.loops.ConfigurationReport",
    "mbs.loops.modes": "mbs.loops.assembly_modes",
    "mbs.loops.closure": "mbs.loops.closure_residual",
    "mbs.identification.joint_side": "mbs.identification.motor_to_joint",
    "mbs.identification.held_out": "mbs.identification.holdout_residuals",
    "mbs.identification.recovered": "mbs.identification.full_parameters",
    "mbs.identification.reweighted": "mbs.identification.iteratively_reweighted",
    "mbs.identification.robust": "mbs.identification.huber",
    "mbs.identification.consistent": "mbs.identification.physically_consistent",
    "mbs.identification.values_of": "mbs.identification.symbolic_parameters",
    "mbs.identification.numbers_of": "mbs.identification.numeric_parameters",
    "mbs.identification.Series": "mbs.identification.FourierSettings",
    "mbs.bridges.invariants": "mbs.bridges.constraint_residuals",
    "mbs.spatial.Movable": "mbs.spatial.Transformable",
    "mbs.spatial.body_through": "mbs.spatial.transform_inertia_along",
    "mbs.spatial.wrench_through": "mbs.spatial.transform_wrench_along",
}
"""Public names of version 0.1 and their present names."""


def found(name):
    module, _, attribute = name.rpartition(".")
    return getattr(importlib.import_module(module), attribute)


@pytest.mark.parametrize(("old", "new"), RENAMED.items())
def test_an_old_name(old, new):
    with pytest.warns(DeprecationWarning, match=rf"{old} is now {new}; change the import"):
        assert found(old) is found(new)


def test_an_unknown_name():
    with pytest.raises(AttributeError, match=r"module 'mbs\.components' has no attribute 'Gadget'"):
        found("mbs.components.Gadget")


ATTRIBUTES = {
    "active": "independent",
    "free": "chosen_coordinates",
    "speeds": "velocity_coordinates",
    "described": "parameterised_components",
    "content": "fingerprint",
    "recent": "memoised",
    "z": "component_states",
    "z_start": "component_start",
}
"""Attributes of a System in version 0.1 and their present names."""


@pytest.mark.parametrize(("old", "new"), ATTRIBUTES.items())
def test_an_old_attribute_of_a_system(old, new):
    system = mbs.load("four_bar").assemble()
    with pytest.warns(DeprecationWarning, match=rf"System\.{old} is now System\.{new}"):
        value = getattr(system, old)
    assert str(value) == str(getattr(system, new))


def test_the_old_name_of_connect_signal():
    with pytest.warns(DeprecationWarning, match=r"Description\.wire is now Description\.connect"):
        assert mbs.Mechanism.wire is mbs.Mechanism.connect_signal
