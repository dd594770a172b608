"""Mechanisms as FMUs: the same motion in every interface, branches of loops, old computers."""

import zipfile

import casadi
import numpy as np
import pytest
from elf_versions import glibc_versions
from fmu_mechanisms import CASES, imported, simulated
from support.catalogue_systems import catalogue_system

import mbs
from mbs.components import (
    Body,
    Box,
    Custom,
    Free,
    Planar,
    Prismatic,
    Revolute,
    RollingDisc,
    custom,
)
from mbs.errors import ModelError


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


def test_starts_have_the_names_of_run(four_bar):
    by_variable = start_configuration(four_bar, **{"j1.q": 0.4})
    assert np.array_equal(start_configuration(four_bar, j1=0.4), by_variable)
    assert not np.allclose(start_configuration(four_bar), by_variable)
    with pytest.raises(ModelError, match=r"start: j1 and j1\.q are the same variable"):
        start_configuration(four_bar, **{"j1": 0.4, "j1.q": 0.4})


@pytest.mark.parametrize("name", ["j2", "j2.q"])
def test_a_start_of_a_dependent_joint_is_a_state(four_bar, name):
    said = r"start: j2\.q follows from the loops; give j1\.q, and j2\.solved as a guess"
    with pytest.raises(ModelError, match=said):
        start_configuration(four_bar, **{name: 0.9})
    state = mbs.simulate.run(catalogue_system("four_bar"), 1e-3, q0={"j2": 0.9}).state(0)
    result = mbs.simulate.fmu(four_bar, 0.001, start=state, step=0.001, quiet=True)
    assert result["j2.q"][0] == pytest.approx(0.9, abs=1e-9)


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


# ---- rows that bind velocities alone ----


class Edge(Custom):
    """A point slides along the x axis of its frame alone."""

    point = custom.frame()

    def velocity_rows(self, at):
        """What slides across."""
        return {"side": casadi.dot(at.point.R[:, 1], at.point.v)}


@pytest.mark.parametrize(("fmi", "solver"), [("2.0", "dopri5"), ("3.0", "rodas")])
def test_a_knife_edge_rotates_through_where_its_states_determine_nothing(fmi, solver, tmp_path):
    # Neimark and Fufaev: x = g sin(slope) sin^2(w t) / (2 w^2), across the slope as a cycloid
    m = mbs.Mechanism("sleigh", gravity=(4.0, 0, 0))
    sleigh = m.add(Body("sleigh", mass=3.0, inertia=(0.1, 0.1, 0.2)))
    m.connect(m.world, Planar("p", axis="z", actuated=False), sleigh)
    m.add(Edge("edge", sleigh))
    system = m.assemble()
    assert [system.velocity_coordinates[k].name for k in system.independent] == ["p.s_x", "p.phi"]
    path = mbs.export.fmu(system, tmp_path / "sleigh.fmu", fmi=fmi, solver=solver)
    w, result = 1.5, mbs.simulate.fmu(path, 4.0, start={"p.phi.v": 1.5}, step=0.05, quiet=True)
    t = result.time
    assert np.abs(result["p.s_x.q"] - 2 / w**2 * np.sin(w * t) ** 2).max() < 1e-7
    assert np.abs(result["p.s_y.q"] - 2 / w**2 * (w * t - 0.5 * np.sin(2 * w * t))).max() < 1e-7


def test_a_coin_rolls_through_where_its_states_determine_nothing(tmp_path):
    m = mbs.Mechanism("coin", gravity=(0, 0, -9.81))
    body = m.add(Body("body", mass=0.4, inertia=(1e-3, 2e-3, 1e-3)))
    m.connect(m.world, Free("f"), body)
    m.connect(m.world, RollingDisc("rolls", radius=0.1, normal="z", axis="y"), body)
    system = m.assemble(guess={"f.z": 0.1}, active=("f.wx", "f.wy", "f.wz"))
    path = mbs.export.fmu(system, tmp_path / "coin.fmu")
    v0 = {"f.wx": 0.3, "f.wy": 12.0, "f.wz": 1.0}
    start = {f"{name}.v": value for name, value in v0.items()}
    found = mbs.simulate.fmu(path, 2.0, start=start, step=0.01, tolerance=1e-9, quiet=True)
    wanted = mbs.simulate.run(system, 2.0, v0=v0, tolerance=1e-10, quiet=True)
    for coordinate in system.coordinates:
        name = f"{coordinate.name}.q"
        assert np.abs(found[name] - wanted[name]).max() < 1e-7


def slider_crank():
    m = mbs.Mechanism("slider_crank", gravity=(0, 0, 0))
    crank = m.add(Box("crank", length=0.1, width=0.04, density=7850))
    rod = m.add(Box("rod", length=0.4, width=0.03, density=7850))
    slider = m.add(Body("slider", 1.0, inertia=(1, 1, 1)))
    m.connect(m.world, Revolute("main", actuated=True, limits=(-2.0, 4.0)), crank.left)
    m.connect(crank.right, Revolute("big", limits=(-4.0, 4.0)), rod.left)
    m.connect(rod.right, Revolute("small"), slider)
    m.connect(m.world, Prismatic("slide", axis="x", limits=(-0.1, 0.1)), slider)
    return m


@pytest.fixture(scope="module")
def slider_fmu(tmp_path_factory):
    system = slider_crank().assemble(guess={"main": 0.3})
    return system, mbs.export.fmu(system, tmp_path_factory.mktemp("slider") / "slider.fmu")


@pytest.mark.parametrize("seed", range(12))
def test_a_start_is_the_configuration_of_solve(slider_fmu, seed):
    """The same search in C: distances of angles up to whole turns, lengths by the size."""
    system, path = slider_fmu
    rng = np.random.default_rng(seed)
    given = {"main": float(rng.uniform(-1.5, 3))}
    guess = {"big": float(rng.uniform(-6, 6)), "slide": float(rng.uniform(-0.6, 0.6))}
    if seed % 3:
        del guess["big" if seed % 3 == 1 else "slide"]
    expected = mbs.loops.solve(system, given, guess=guess)
    names = [c.name for c in system.coordinates]
    start = {f"{n}.q": x for n, x in given.items()} | {f"{n}.solved": x for n, x in guess.items()}
    result = mbs.simulate.fmu(path, 0.001, start=start, step=0.001, quiet=True)
    found = np.array([result[f"{name}.q"][0] for name in names])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)


def test_rounding_decides_no_sign_of_half_a_turn(tmp_path):
    """Crank and rod are in one line: the rod is half a turn from its start."""
    system = slider_crank().assemble(guess={"main": 0.0})
    path = mbs.export.fmu(system, tmp_path / "line.fmu")
    for main in (0.0, 1e-12, -1e-12):
        start = {"main.q": main, "slide.solved": -0.3}
        result = mbs.simulate.fmu(path, 0.001, start=start, step=0.001, quiet=True)
        solved = mbs.loops.solve(system, {"main": main}, guess={"slide": -0.3})
        for big in (result["big.q"][0], solved[1]):
            assert big == pytest.approx(np.pi, abs=1e-9)


def test_a_start_that_the_loops_cannot_take_is_one_error(tmp_path):
    m = mbs.Mechanism("short", gravity=(0, 0, 0))
    crank = m.add(Box("crank", length=0.4, width=0.04, density=7850))
    rod = m.add(Box("rod", length=0.3, width=0.03, density=7850))
    slider = m.add(Body("slider", 1.0, inertia=(1, 1, 1)))
    m.connect(m.world, Revolute("main", actuated=True), crank.left)
    m.connect(crank.right, Revolute("big"), rod.left)
    m.connect(rod.right, Revolute("small"), slider)
    m.connect(m.world, Prismatic("slide", axis="x"), slider)
    path = mbs.export.fmu(m.assemble(guess={"main": 0.3}), tmp_path / "short.fmu")
    for start in ({"main.q": 1.5}, {"main.q": 1.5, "big.solved": -2.0}):
        with pytest.raises(mbs.errors.SolverError, match="loops"):
            mbs.simulate.fmu(path, 0.001, start=start, step=0.001, quiet=True)
