"""Old public names work with a DeprecationWarning that gives the present name."""

import importlib

import pytest

import mbs
import mbs.components


def test_a_name_that_has_moved():
    with pytest.warns(
        DeprecationWarning, match=r"mbs\.components\.Mechanism is now mbs\.Mechanism"
    ):
        assert mbs.components.Mechanism is mbs.Mechanism


def test_an_unknown_name():
    module = importlib.import_module("mbs.components")
    with pytest.raises(AttributeError, match=r"module .mbs\.components. has no attribute .Gadget."):
        _ = module.Gadget
