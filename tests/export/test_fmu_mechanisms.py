"""Mechanisms as FMUs: the same motion in every interface, branches of loops, old computers."""

import zipfile

import numpy as np
import pytest
from elf_versions import glibc_versions
from fmu_mechanisms import CASES, imported, simulated
from support.catalogue_systems import catalogue_system

import mbs


@pytest.mark.sweep
@pytest.mark.parametrize(
    "name", ["four_bar", "five_bar", "floating_body", "two_roots", "massless_slide", "bricard"]
)
def test_model_exchange_co_simulation_and_simulation_agree(name, tmp_path):
    case = CASES[name]
    system = case.system()
    path = mbs.export.fmu(system, tmp_path / f"{name}.fmu", stop_time=case.seconds)
    wanted = simulated(system, case)
    assert np.ptp(wanted, axis=0).max() > 0.1
    scale = 1 + np.abs(wanted).max(axis=0)
    for kind, accuracy in (("CoSimulation", 1e-8), ("ModelExchange", 1e-6)):
        found = imported(path, system, case, kind)
        assert np.abs((found - wanted) / scale).max() < accuracy


# ---- branches of loops ----


@pytest.fixture(scope="module")
def four_bar(tmp_path_factory):
    folder = tmp_path_factory.mktemp("four_bar")
    path = mbs.export.fmu(catalogue_system("four_bar"), folder / "four_bar.fmu")
    return path


def start_configuration(path, **start):
    """Where the coupler and the rocker are at the start."""
    result = mbs.simulate.fmu(path, 0.001, start=start, step=0.001, quiet=True)
    return np.array([result[name][0] for name in ("j2.q", "j4.q")])


def wrapped(angles):
    return np.arctan2(np.sin(angles), np.cos(angles))


def test_one_guess_chooses_a_branch_of_the_loop(four_bar):
    open_branch = start_configuration(four_bar)
    crossed = start_configuration(four_bar, **{"j2.solved": -1.0})
    by_rocker = start_configuration(four_bar, **{"j4.solved": -1.4})
    assert np.allclose(crossed, -open_branch, atol=1e-9)  # the crank lies in line with the ground
    assert np.allclose(wrapped(by_rocker - crossed), 0, atol=1e-9)


def test_a_guess_near_the_own_branch_keeps_it(four_bar):
    start = {"j1.q": 0.4}
    assert np.allclose(
        start_configuration(four_bar, **start, **{"j2.solved": 0.9}),
        start_configuration(four_bar, **start),
        atol=1e-9,
    )


# ---- other computers ----


def test_a_library_for_linux_needs_no_glibc_after_2_17(tmp_path):
    pytest.importorskip("ziglang")
    path = mbs.export.fmu(
        catalogue_system("puma560"), tmp_path / "arm.fmu", platforms=["x86_64-linux"]
    )
    with zipfile.ZipFile(path) as archive:
        library = archive.read("binaries/linux64/puma560.so")
    versions = glibc_versions(library)
    assert versions
    assert max(versions) <= (2, 17)
