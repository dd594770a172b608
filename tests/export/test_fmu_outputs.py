"""What an FMU shows on request, beside motions and the pose of the terminal frame."""

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.observed_four_bar import four_bar

import mbs
from mbs.components import Box, Fixed, Revolute
from mbs.errors import ModelError
from mbs.export.fmu.options import FmuOptions
from mbs.export.fmu.system_fmu import fmu_model


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("outputs") / "observed.fmu"
    system = four_bar()
    groups = ("sensors", "energy", "closure", "poses", "cut_forces", "motion:probe")
    mbs.export.fmu(system, path, fmi="3.0", outputs=groups)
    fmu = mbs.simulate.fmu(
        path, 0.5, step=0.05, inputs={"j1.tau": 1.5}, tolerance=1e-10, quiet=True
    )
    own = mbs.simulate.run(
        system, 0.5, q0={}, tau={"j1": 1.5}, step=0.05, tolerance=1e-10, quiet=True
    )
    return system, fmu, own


def test_sensors_read_what_a_simulation_reads(run):
    system, fmu, own = run
    names = [name for sensor in system.sensors for name, _ in sensor.columns]
    assert len(names) > 30
    for name in names:
        size = 1 + np.abs(own[name]).max()
        assert np.abs(fmu[name] - own[name]).max() < 1e-6 * size, name
        assert fmu.units[name] == own.units[name]


def test_energy_grows_by_the_work_of_the_motor(run):
    _, fmu, _ = run
    total = fmu["energy.kinetic"] + fmu["energy.potential"]
    work = 1.5 * (fmu["j1.q"] - fmu["j1.q"][0])
    assert np.abs(total - total[0] - work).max() < 1e-8 * np.abs(total).max()


def test_loops_are_closed(run):
    _, fmu, _ = run
    assert np.abs(fmu["closure"]).max() < 1e-12


def test_unknown_outputs_are_refused_with_a_proposal(tmp_path):
    with pytest.raises(ModelError, match=r"four_bar: the FMU has no outputs 'energie'.*'energy'"):
        mbs.export.fmu(four_bar(), tmp_path / "x.fmu", outputs=["energie"])


def test_poses_and_cut_forces_are_those_of_the_models(run):
    system, fmu, own = run
    for row in (0, -1):
        q, v, a, tau = (
            [own[f"{x.name}.{kind}"][row] for x in rows]
            for kind, rows in (
                ("q", system.coordinates),
                ("v", system.velocity_coordinates),
                ("a", system.velocity_coordinates),
                ("tau", system.velocity_coordinates),
            )
        )
        F = np.array(mbs.models.joint_wrenches(system, "tree")(q, v, a, tau))
        for column, joint in enumerate(system.joints):
            told = [fmu[f"{joint.name}.{kind}.{axis}"][row] for kind in "fm" for axis in "xyz"]
            assert np.abs(told - F[:, column]).max() < 1e-5 * (1 + np.abs(F).max()), joint.name
        for body in system.bodies:
            T = np.array(mbs.models.transform(system, body.name)(q))
            place = [fmu[f"{body.name}.{axis}"][row] for axis in "xyz"]
            turn = [[fmu[f"{body.name}.R{i}{j}"][row] for j in (1, 2, 3)] for i in (1, 2, 3)]
            assert np.abs(T[:3] - np.column_stack([turn, place])).max() < 1e-7, body.name


def test_flange_motion_is_what_a_sensor_reads(run):
    _, fmu, own = run
    for ours, theirs in (("v", "v"), ("w", "w"), ("a", "a"), ("wd", "wd")):
        for axis in "xyz":
            one, other = fmu[f"probe.{ours}{axis}"], own[f"tip.{theirs}.{axis}"]
            assert np.abs(one - other).max() < 1e-6 * (1 + np.abs(other).max()), (ours, axis)


def test_single_outputs_and_groups_overlap_without_repetition() -> None:
    names = ["sensor:tip", "wrench:j2", "pose:a", "poses", "motion:tool"]
    model = fmu_model(four_bar(), FmuOptions(outputs=names))
    told = [variable.name for variable in model.outputs]
    assert len(told) == len(set(told))
    assert {"tip.p.x", "j2.f.x", "a.x", "b.x", "tool.vx"} <= set(told)
    assert "pin.f.x" not in told


@pytest.mark.parametrize(
    ("outputs", "message"),
    [
        (["pose:aa"], r"no outputs 'pose:aa'; did you mean .*'pose:a'"),
        (["cut forces"], r"did you mean 'cut_forces'"),
        (["energy", "energy"], r"outputs name 'energy' twice"),
        ([2], r"outputs name 2; give texts"),
    ],
)
def test_bad_outputs_are_refused(outputs, message) -> None:
    with pytest.raises(ModelError, match=rf"four_bar: .*{message}|four_bar: {message}"):
        fmu_model(four_bar(), FmuOptions(outputs=outputs))


def test_a_system_without_sensors_has_none_to_show() -> None:
    with pytest.raises(ModelError, match="there is no sensor to show; add one"):
        fmu_model(catalogue_system("four_bar"), FmuOptions(outputs=["sensors"]))


def test_wrenches_of_welds_and_outer_wrenches_on_their_link_are_refused() -> None:
    m = mbs.Mechanism("welded", gravity=(0, -9.81, 0))
    a, b = (m.add(Box(name, length=0.5, mass=1.0)) for name in "ab")
    m.connect(m.world, Revolute("j1"), a.left)
    m.connect(a.right, Fixed("hold"), b.left)
    system = m.assemble()
    assert "hold.f.x" in [
        y.name for y in fmu_model(system, FmuOptions(outputs=["cut_forces"])).outputs
    ]
    with pytest.raises(ModelError, match="welded: what hold transmits cannot be shown"):
        fmu_model(system, FmuOptions(outputs=["cut_forces"], inputs=["b.wrench"]))
