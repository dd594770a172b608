"""An installed wheel without a C compiler: the run-time library integrates and solves."""

import os

import numpy as np
import pytest

import mbs


@pytest.fixture(autouse=True)
def no_compiler(monkeypatch):
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)


def test_a_closed_loop_moves():
    system = mbs.load("four_bar").assemble()
    result = mbs.simulate.run(system, 0.5, tolerance=1e-9, quiet=True)
    energy = result["kinetic_energy"] + result["potential_energy"]
    assert np.ptp(energy) < 1e-7
    assert result["closure_residual"].max() < 1e-11


def test_an_arm_is_solved():
    system = mbs.load("puma560").assemble()
    q = np.array([0.3, -0.7, 0.5, 0.4, 0.9, -0.2])
    T = np.array(mbs.models.direct_geometry(system)(q))
    answer = mbs.models.inverse_geometry.solve(system, T)
    assert len(answer) == 8
    assert np.min(np.max(np.abs(answer.q - q), axis=1)) < 1e-9


def test_the_library_is_that_of_the_package():
    from mbs.core.build import LIBRARY, is_current

    assert is_current()
    assert os.path.samefile(mbs.core.core_library().__file__, LIBRARY)
