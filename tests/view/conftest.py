"""Mechanisms of the catalogue, each assembled once for all pictures."""

import functools

import pytest
from support.catalogue_systems import catalogue_system

import mbs


@pytest.fixture(scope="session")
def assembled():
    @functools.cache
    def assemble(name):
        return catalogue_system(name)

    return assemble


@pytest.fixture(scope="session")
def swing(assembled):
    """A second of the four-bar linkage, falling from its configuration."""
    return mbs.simulate.run(assembled("four_bar"), 1.0, q0={"j1": 0.4}, step=0.05, quiet=True)
