"""Exciting motions within limits, of open and closed systems."""

import importlib
import re
from functools import cache

import numpy as np
import pytest

import mbs
from mbs.assembly import System
from mbs.components import Body, Revolute
from mbs.errors import ModelError, NoClosedForm, SolverError
from mbs.identification import (
    FourierSettings,
    Plane,
    Trajectory,
    base_parameters,
    excitation,
    regressor,
)
from mbs.identification.leading import active_indices
from mbs.identification.trajectory import Margin, MotionLimit, limits_of
from mbs.loops.closing import Closing

FORM = FourierSettings(period=6.0, harmonics=3, samples=40)


@cache
def system_of(name: str) -> System:
    return mbs.load(name).assemble()


@cache
def planar() -> Trajectory:
    return excitation(
        system_of("planar_2r"),
        series=FORM,
        position=[(-1.5, 1.0), 2.0],
        velocity=3.0,
        acceleration=[8.0, None],
        effort=[20.0, (-4.0, 5.0)],
        planes=[Plane(2, (0.3, 0.0, 0.0), (0.0, 2.0, 0.0), -0.2)],
        starts=2,
    )


def test_motion_keeps_every_limit_at_every_instant() -> None:
    found, t = planar(), np.linspace(0, 6, 3001)
    q, v, a = found.q(t), found.v(t), found.a(t)
    system = found.system
    tau = np.array(mbs.models.inverse_dynamics(system).map(len(t))(q.T, v.T, a.T)).T
    T = np.array(mbs.models.transform(system, 2).map(len(t))(q.T)).reshape(4, len(t), 4)
    height = T[1, :, 0] * 0.3 + T[1, :, 3]
    assert (q[:, 0] >= -1.5).all()
    assert (q[:, 0] <= 1.0).all()
    assert np.abs(q[:, 1]).max() <= 2.0
    assert np.abs(v).max() <= 3.0
    assert np.abs(a[:, 0]).max() <= 8.0
    assert np.abs(tau[:, 0]).max() <= 20.0 * (1 + 1e-3)
    assert tau[:, 1].min() >= -4.0 * (1 + 1e-3)
    assert tau[:, 1].max() <= 5.0 * (1 + 1e-3)
    assert height.min() >= -0.2 - 1e-3


def test_margins_are_of_the_motion() -> None:
    found, t = planar(), np.linspace(0, 6, 3001)
    fastest = np.abs(found.v(t)).max()
    assert found.worst("velocity").worst == pytest.approx(3.0 - fastest, abs=1e-3)
    for quantity in ("position", "velocity", "acceleration", "effort", "plane"):
        assert found.worst(quantity).part >= -1e-6
    with pytest.raises(ModelError, match="no jerk of"):
        found.worst("jerk")


def test_motion_starts_and_ends_at_rest() -> None:
    found = planar()
    for t in (0.0, 6.0):
        assert found.v(t) == pytest.approx(np.zeros(2), abs=1e-12)
        assert found.a(t) == pytest.approx(np.zeros(2), abs=1e-11)


def test_condition_is_that_of_the_regressor() -> None:
    found = planar()
    D = regressor(found.system)
    places = [D.names.index(column.name) for column in found.columns]
    t = np.arange(320) * 6 / 320
    blocks = [np.array(D(found.q(x), found.v(x), found.a(x)))[:, places] for x in t]
    W = np.vstack(blocks)
    assert found.condition == pytest.approx(np.linalg.cond(W), rel=1e-9)
    scaled = np.linalg.cond(W / np.linalg.norm(W, axis=0))
    assert found.scaled_condition == pytest.approx(scaled, rel=1e-9)


def test_table_and_text() -> None:
    found = planar()
    table = found.table(100.0, periods=2)
    assert len(table) == 1201
    assert table.names == ("q1.q", "q2.q", "q1.v", "q2.v", "q1.a", "q2.a")
    assert table.values[600] == pytest.approx(table.values[0], abs=1e-10)
    text = found.text()
    assert f"{len(found.columns)} columns" in text
    assert len(re.findall(r"^(?:effort|plane|velocity) ", text, re.MULTILINE)) == 5


def test_puma_is_seen_well() -> None:
    system = system_of("puma560")
    base = base_parameters(system)
    limits = {"position": 2.5, "velocity": 2.0, "acceleration": 6.0}
    found = excitation(
        system, base, objective="scaled_condition", starts=1, rounds=30, seed=1, **limits
    )
    assert len(found.columns) == 52
    assert found.scaled_condition < 9
    t = np.linspace(0, 10, 2001)
    assert np.abs(found.q(t)).max() <= 2.5 + 1e-9
    assert np.abs(found.v(t)).max() <= 2.0 + 1e-9
    assert np.abs(found.a(t)).max() <= 6.0 + 1e-9


def test_condition_of_52_columns_of_puma() -> None:
    found = excitation(
        system_of("puma560"),
        series=FourierSettings(samples=60),
        position=2.5,
        velocity=3.0,
        acceleration=8.0,
        objective="condition",
        starts=1,
        rounds=100,
    )
    assert len(found.columns) == 52
    assert found.condition < 30
    assert all(margin.part >= 0 for margin in found.margins if margin.limit.is_finite)


def test_columns_may_have_the_names_of_base_parameters() -> None:
    system = system_of("planar_2r")
    base, options = base_parameters(system), {"starts": 1, "rounds": 5, "position": 1.0}
    named = excitation(system, base.columns_in_base, series=FORM, **options)
    plain = excitation(system, base, series=FORM, **options)
    assert named.condition == plain.condition
    assert [c.name for c in named.columns] == list(base.names)


def test_a_plane_through_the_origin_is_kept_as_any_other() -> None:
    limit = MotionLimit("plane", "2", "m", 0.0, np.inf)
    assert Margin(limit, -1e-9, 0.5).part == -1e-9
    assert Margin(MotionLimit("effort", "q1", "N.m", -2.0, 4.0), -1.0, 1.0).part == 0.25


def test_same_seed_gives_the_same_motion() -> None:
    system = system_of("planar_2r")
    first, second = (
        excitation(system, position=1.0, series=FORM, starts=1, rounds=10) for _ in range(2)
    )
    assert first.series.sine == pytest.approx(second.series.sine, abs=0)


def test_closed_robot_keeps_its_loop_closed() -> None:
    system = system_of("five_bar")
    middle = [system.configuration[k] for k in system.independent]
    found = excitation(
        system,
        series=FORM,
        position=[(x - 0.5, x + 0.5) for x in middle],
        velocity=2.0,
        effort=30.0,
        objective="scaled_condition",
        starts=1,
        rounds=40,  # after 20 the start that was drawn still shows: 57 to 110
    )
    t = np.linspace(0, 6, 25)
    configurations = found.configuration(t)
    assert configurations[:, list(system.independent)] == pytest.approx(found.q(t), abs=1e-14)
    for q in configurations[::6]:
        closed = mbs.loops.solve(system, q[list(system.independent)].tolist())
        assert np.array(closed).ravel() == pytest.approx(q, abs=1e-9)
    assert len(found.columns) == 19
    assert found.scaled_condition < 100


def test_loops_without_closed_form_are_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(_: System) -> None:
        raise NoClosedForm("no closed form")

    system = mbs.load("five_bar").assemble()
    middle = [system.configuration[k] for k in system.independent]
    options = {
        "series": FORM,
        "position": [(x - 0.3, x + 0.3) for x in middle],
        "starts": 1,
        "rounds": 3,
    }
    explicit = excitation(system, **options)
    monkeypatch.setattr("mbs.identification.leading.closed_form", refused)
    followed = excitation(system, **options)
    t = np.linspace(0, 6, 9)
    assert followed.configuration(t) == pytest.approx(explicit.configuration(t), abs=1e-4)
    assert followed.condition == pytest.approx(explicit.condition, rel=1e-3)


def test_impossible_effort_is_told() -> None:
    with pytest.raises(SolverError, match=r"the effort of \w+ passes its limit by"):
        excitation(
            system_of("planar_2r"), series=FORM, position=(1.0), effort=0.01, starts=1, rounds=10
        )


def test_columns_that_depend_on_each_other_are_told() -> None:
    system = system_of("planar_2r")
    with pytest.raises(SolverError, match="group them with base_parameters"):
        excitation(system, regressor(system).columns, position=1.0, series=FORM)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"position": [1.0]}, "position has 1 limits for 2 independent joints"),
        ({"position": 1.0, "velocity": -2.0}, "velocity of .* is -2.0; give a positive number"),
        ({"position": [(1.0, 0.5), 1.0]}, r"position of .* is \(1.0, 0.5\)"),
        ({"position": 1.0, "velocity": [(0.1, 1.0), 1.0]}, "between 0.1 and 1; .* zero inside"),
        ({"position": 1.0, "effort": float("inf")}, "effort of .* is inf; give a positive number"),
        ({"position": [None, 1.0]}, "has no range of positions"),
        ({"position": 170}, "may go to 170 rad, .* numpy.radians"),
        ({"position": 1.0, "columns": ["ZZ1R"]}, "columns holds 'ZZ1R', which is no Column"),
        ({"position": 1.0, "objective": "logdet"}, "did you mean 'log_det'"),
        ({"position": 1.0, "starts": 0}, "0 starts"),
        ({"position": 1.0, "rounds": 0}, "0 rounds"),
        ({"position": 1.0, "columns": ()}, "no column is to be identified"),
    ],
)
def test_wrong_input_is_told(options: dict[str, object], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        excitation(system_of("planar_2r"), series=FORM, **options)


def test_wrong_series_and_planes_are_told() -> None:
    with pytest.raises(ModelError, match="1 harmonics cannot start and end at rest"):
        FourierSettings(harmonics=1)
    with pytest.raises(ModelError, match=r"harmonics is 2\.5; give a whole number"):
        FourierSettings(harmonics=2.5)
    with pytest.raises(ModelError, match="period is 0 s"):
        FourierSettings(period=0.0)
    with pytest.raises(ModelError, match="10 samples are too few for 5 harmonics"):
        FourierSettings(samples=10)
    with pytest.raises(ModelError, match="normal is zero"):
        Plane("tool", (0, 0, 0), (0, 0, 0), 1.0)
    with pytest.raises(ModelError, match="no seven finite numbers"):
        Plane("tool", (0, 0, 0), (0, 0, float("nan")), 1.0)


def gap(system: System, configurations: np.ndarray) -> float:
    """Largest error with which configurations close the loops."""
    closing = Closing(system, np.array(system.parameter_values()))
    return max(float(np.abs(closing.rows(q)[0]).max()) for q in configurations)


@pytest.mark.parametrize(
    ("name", "half", "passive"),
    [("four_bar", 1.5, ("j4", 1.0, 1.7)), ("sr400", 0.5, ("q3", 2.74, 3.44))],
)
def test_passive_joints_of_closed_robots_keep_their_limits(
    name: str, half: float, passive: tuple[str, float, float]
) -> None:
    system, (joint, low, high) = system_of(name), passive
    coordinates = [c.name for c in system.coordinates]
    places = active_indices(system)
    ranges = {
        coordinates[k]: (system.configuration[k] - half, system.configuration[k] + half)
        for k in places
    }
    found = excitation(
        system,
        series=FourierSettings(period=6.0, harmonics=3, samples=24),
        position=ranges | {joint: (low, high)},
        velocity=dict.fromkeys(ranges, 3.0),
        effort=400.0,
        starts=1,
        rounds=4,
        quiet=True,
    )
    t = np.linspace(0, 6, 601)
    configurations = found.configuration(t)
    turned = configurations[:, coordinates.index(joint)]
    assert turned.min() >= low - 1e-3
    assert turned.max() <= high + 1e-3
    assert np.ptp(turned) > 0.3
    assert np.abs(np.diff(configurations, axis=0)).max() < 0.1
    assert gap(system, configurations[::20]) < 1e-9
    for k, place in enumerate(places):
        assert configurations[:, place].min() >= ranges[coordinates[place]][0]
        assert configurations[:, place].max() <= ranges[coordinates[place]][1]
        assert np.abs(found.v(t)[:, k]).max() <= 3.0
    v, a = found.v(t[::5]), found.a(t[::5])
    model = mbs.models.inverse_dynamics(system)
    tau = np.array(model.map(len(v))(configurations[::5].T, v.T, a.T))
    assert np.abs(tau).max() <= 400.0 * (1 + 1e-3)


def test_a_platform_that_follows_keeps_its_height() -> None:
    system = system_of("delta")
    found = excitation(
        system,
        series=FourierSettings(period=4.0, harmonics=2, samples=8),
        position={"q1": 0.4, "q2": 0.4, "q3": 0.4, "platform.z": (-0.55, -0.42)},
        velocity=3.0,
        starts=1,
        rounds=1,
        quiet=True,
    )
    configurations = found.configuration(np.linspace(0, 4, 41))
    height = configurations[:, [c.name for c in system.coordinates].index("platform.z")]
    assert height.min() >= -0.55 - 1e-3
    assert height.max() <= -0.42 + 1e-3
    assert gap(system, configurations) < 1e-9
    assert found.table(10.0).names[:3] == ("q1.q", "q2.q", "q3.q")


def test_limits_of_unknown_joints_are_refused() -> None:
    system = system_of("five_bar")
    with pytest.raises(ModelError, match=r"position names 'q9', which is none of its joints"):
        excitation(system, position={"q9": 1.0})
    with pytest.raises(ModelError, match="velocity names 'q2', which is none"):
        excitation(system, position=1.0, velocity={"q2": 1.0})


def test_limits_that_joints_describe_are_those_by_default() -> None:
    m = mbs.Mechanism("arm")
    bars = [m.add(Body(n, mass=1.0, com=(0.1, 0, 0), inertia=(1, 1, 1))) for n in "ab"]
    described = {"limits": (-2.0, 2.0), "velocity": 3.0, "effort": (-4.0, 5.0)}
    m.connect(m.world, Revolute("q1", axis="y", **described), bars[0])
    m.connect(bars[0].at(0.3), Revolute("q2", axis="y", limits=(-1.0, 1.0), effort=np.inf), bars[1])
    system = m.assemble()

    def ends(limits: tuple[MotionLimit, ...]) -> list[tuple[float, float]]:
        return [(row.lower, row.upper) for row in limits]

    free, taken = (-np.inf, np.inf), limits_of(system)
    assert ends(taken.position) == [(-2.0, 2.0), (-1.0, 1.0)]
    assert ends(taken.velocity) == [(-3.0, 3.0), free]
    assert ends(taken.effort) == [(-4.0, 5.0), free]
    assert ends(taken.acceleration) == [free, free]
    given = limits_of(system, velocity={"q2": 1.5}, effort={"q1": None})
    assert ends(given.velocity) == [(-3.0, 3.0), (-1.5, 1.5)]
    assert ends(given.effort) == [free, free]
    assert ends(limits_of(system, velocity=2.0).velocity) == [(-2.0, 2.0)] * 2


def test_what_is_no_series_or_no_number_is_refused() -> None:
    system = system_of("planar_2r")
    with pytest.raises(ModelError, match=r"the series is \(4, 2\); give mbs"):
        excitation(system, series=(4, 2), position=1.0)  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="velocity is '2'; give a number, a range"):
        excitation(system, series=FORM, position=1.0, velocity="2")


def test_the_function_does_not_hide_a_package() -> None:
    assert mbs.identification.excitation is excitation
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("mbs.identification.excitation")
