"""Loops: where they are cut, what they leave free, and what is said of those that cannot be."""

import numpy as np
import pytest
from support.messages import refused

import mbs
import mbs.models
import mbs.simulate
from mbs.components import (
    Body,
    Box,
    Coupling,
    Cylindrical,
    Fixed,
    Free,
    Planar,
    PointMass,
    Prismatic,
    Revolute,
    Spherical,
    Universal,
)
from mbs.errors import AssemblyError, Unclosable

DOWN = (0, -9.81, 0)


def bar(name, length):
    return Box(name, length=length, width=0.05, density=2700)


def solid(name):
    return Body(name, 1.0, (0.1, 0.1, 0.05), (0.1, 0.12, 0.15))


def four_bar(lengths=(0.4, 1.0, 0.9), ground=0.8, base=None, **options):
    """Joints j1 .. j4, each with the options given for it."""
    m = mbs.Mechanism("m", gravity=DOWN)
    a, b, c = (m.add(bar(n, x)) for n, x in zip("abc", lengths, strict=True))
    start = base(m) if base else m.world

    def joint(name):
        return Revolute(name, **options.get(name, {}))

    m.connect(start, joint("j1"), a.left)
    m.connect(a.right, joint("j2"), b.left)
    m.connect(b.right, joint("j3"), c.right)
    m.connect(start.at(ground), joint("j4"), c.left)
    return m


def cuts(system):
    return [cut.edge.joint.name for cut in system.cuts]


def names(system):
    return [c.name for c in system.coordinates]


@pytest.mark.parametrize("driven", ["j1", "j2", "j3", "j4"])
def test_a_driven_joint_stays_in_the_tree(driven):
    system = four_bar(**{driven: {"actuated": True}}).assemble(guess={"j2": 1.0})
    assert driven in names(system)
    assert cuts(system) != [driven]
    assert [system.velocity_coordinates[k].name for k in system.independent] == [driven]


def test_guessed_joints_stay_in_the_tree():
    assert cuts(four_bar().assemble(guess={"j2": 1.0, "j3": -1.8})) == ["j4"]
    assert cuts(four_bar().assemble(guess={"j3": 1.0, "j4": 1.8})) in (["j1"], ["j2"])


def test_the_user_may_choose_the_cut():
    for name in ("j1", "j2", "j3", "j4"):
        m = four_bar()
        m.cut(m.components[name])
        system = m.assemble()
        assert cuts(system) == [name]
        assert system.loops[0].name == name
        assert [c.name for c in system.cut_coordinates] == [name]


def test_the_freest_joint_is_cut():
    m = mbs.Mechanism("m", gravity=DOWN)
    a, b, c = (m.add(bar(n, x)) for n, x in zip("abc", (0.4, 1.0, 0.9), strict=True))
    m.connect(m.world, Spherical("ball"), a.left)
    m.connect(a.right, Universal("u", axes=("y", "z")), b.left)
    m.connect(b.right, Revolute("j3"), c.right)
    m.connect(m.world.at(0.8), Revolute("j4"), c.left)
    system = m.assemble()
    assert cuts(system) == ["ball"]
    assert system.loops[0].closing == "spherical"
    assert len(system.loops[0].rows) == 3
    assert [c.name for c in system.cut_coordinates] == ["ball.qw", "ball.qx", "ball.qy", "ball.qz"]


def test_a_cut_joint_with_friction_keeps_its_coordinate():
    every = {f"j{k}": {"Fv": 0.5} for k in (1, 2, 3, 4)}
    system = four_bar(**every).assemble(guess={"j2": 1.0})
    assert sorted(names(system)) == ["j1", "j2", "j3", "j4"]
    row = system.loops[0]
    assert (row.closing, len(row.rows)) == ("weld", 6)
    plain = four_bar().assemble(guess={"j2": 1.0})
    assert system.closure.mobility == plain.closure.mobility == 1
    assert "weld" in system.report()


def test_friction_in_a_welded_cut_joint_does_work():
    every = {f"j{k}": {"Fv": 0.1 * k} for k in (1, 2, 3, 4)}
    system = four_bar(**every).assemble(guess={"j2": 1.0})
    driver = system.velocity_coordinates[system.independent[0]].name
    run = mbs.simulate.run(system, duration=0.4, v0={driver: 3.0}, step=0.002, quiet=True)
    E = np.array(run["kinetic_energy"]) + np.array(run["potential_energy"])
    power = sum(0.1 * k * np.array(run[f"j{k}.v"]) ** 2 for k in (1, 2, 3, 4))
    t = np.array(run.time)
    lost = np.sum((power[1:] + power[:-1]) / 2 * np.diff(t))
    assert E[0] - E[-1] == pytest.approx(lost, rel=1e-4)
    assert lost > 0.1


def test_a_loop_away_from_the_base():
    def carried(m):
        arm = m.add(solid("arm"))
        m.connect(m.world, Revolute("shoulder"), arm)
        return arm

    system = four_bar(base=carried).assemble(guess={"j2": 1.0})
    assert system.closure.mobility == 2
    assert "shoulder" not in system.loops[0].joints
    actuated = {c.name: c.actuated for c in system.coordinates}
    assert actuated.pop("shoulder") is True
    assert not any(actuated.values())


def six_bar():
    m = four_bar(j1={"actuated": True})
    d, e = m.add(bar("d", 0.6)), m.add(bar("e", 0.7))
    m.connect(m.components["b"].at(0.5, 0.1), Revolute("k1"), d.left)
    m.connect(d.right, Revolute("k2"), e.right)
    m.connect(m.world.at(0.3, -0.3), Revolute("k3"), e.left)
    return m, {"j1": 1.0, "j2": 0.3}


def nested_pair():
    m, arm = mbs.Mechanism("pair", gravity=DOWN), mbs.Mechanism("arm", gravity=DOWN)
    upper, fore = arm.add(bar("upper", 0.5)), arm.add(bar("fore", 0.5))
    arm.connect(arm.world, Revolute("s"), upper.left)
    arm.connect(upper.right, Revolute("e"), fore.left)
    arm.add_frame("hand", fore.right)
    left, right = m.add(arm, name="l"), m.add(arm, name="r")
    m.connect(m.world, left.base)
    m.connect(m.world.at(0.8), right.base)
    m.connect(left.point("hand"), Revolute("grip"), right.point("hand"))
    return m, {"l.s": 2.0, "l.e": -1.5, "r.s": 1.0, "r.e": 1.5}


def slider_crank():
    m = mbs.Mechanism("slider", gravity=DOWN)
    a, b, piston = m.add(bar("a", 0.3)), m.add(bar("b", 1.0)), m.add(PointMass("p", 1.0))
    m.connect(m.world, Revolute("j1"), a.left)
    m.connect(a.right, Revolute("j2"), b.left)
    m.connect(b.right, Revolute("j3"), piston)
    m.connect(m.world.at(0, 0.1), Prismatic("s", axis="x"), piston)
    return m, {"j1": 0.5, "s": 1.2}


def planar_loop():
    m = mbs.Mechanism("planar", gravity=DOWN)
    b, c = m.add(bar("b", 1.0)), m.add(bar("c", 0.5))
    m.connect(m.world, Planar("p"), b.left)
    m.connect(b.right, Revolute("k"), c.left)
    m.connect(m.world.at(0.7, 0.6), Revolute("g"), c.right)
    return m, {"k": 1.0}


def cardan():
    m = mbs.Mechanism("cardan")
    a, b = m.add(solid("a")), m.add(solid("b"))
    m.connect(m.world, Revolute("in", axis="x"), a)
    m.connect(a.at(1), Universal("u", axes=("y", "z")), b)
    m.connect(m.world.at(1, rotation=("z", 0.5)), Revolute("out", axis="x"), b)
    return m, {"u.phi_b": 0.5}


def spatial_slider():
    m = mbs.Mechanism("spatial", gravity=DOWN)
    a, b, piston = m.add(bar("a", 0.3)), m.add(bar("b", 1.0)), m.add(solid("p"))
    m.connect(m.world, Revolute("j1"), a.left)
    m.connect(a.right, Spherical("j2"), b.left)
    m.connect(b.right, Universal("j3", axes=("y", "z")), piston)
    m.connect(m.world.at(0, 0.1, 0.1), Cylindrical("s", axis="x"), piston)
    return m, {"j1": 0.5}


def bennett(a=1.0, alpha=0.7, b=1.5):
    beta = np.arcsin(b / a * np.sin(alpha))
    m = mbs.Mechanism("bennett")
    bodies = [m.add(solid(f"b{k}")) for k in range(3)]
    m.connect(m.world, Revolute("j0"), bodies[0])
    m.connect(bodies[0].at_khalil(d=a, alpha=alpha), Revolute("j1"), bodies[1])
    m.connect(bodies[1].at_khalil(d=b, alpha=beta), Revolute("j2"), bodies[2])
    m.connect(
        bodies[2].at_khalil(d=a, alpha=alpha), Revolute("j3"), m.world.at(-b, rotation=("x", -beta))
    )
    return m, {"j0": 1.0, "j1": 1.0, "j2": -1.0}


def bricard():
    m = mbs.Mechanism("bricard")
    before, guess = m.world, {}
    for k in range(5):
        body = m.add(solid(f"b{k}"))
        twist = np.pi / 2 if k % 2 else -np.pi / 2
        m.connect(before.at_khalil(d=1, alpha=twist) if k else m.world, Revolute(f"j{k}"), body)
        before, guess[f"j{k}"] = body, 2.0 if k % 2 else -2.0
    m.connect(
        before.at_khalil(d=1, alpha=np.pi / 2),
        Revolute("j5"),
        m.world.at(rotation=("x", np.pi / 2)).at(-1),
    )
    return m, guess


def floating_four_bar():
    def carried(m):
        hull = m.add(solid("hull"))
        m.connect(m.world, Free("float"), hull)
        return hull

    return four_bar(base=carried), {"j2": 1.0}


def gear():
    m = mbs.Mechanism("gear", gravity=DOWN)
    a, b = m.add(bar("a", 0.5)), m.add(bar("b", 0.3))
    m.connect(m.world, Revolute("j1"), a.left)
    m.connect(m.world.at(1), Revolute("j2"), b.left)
    m.add(Coupling("ratio", "j2", "j1", (0.1, -2.0, 0.3)))
    return m, {}


MECHANISMS = [
    (six_bar, 1, -5),
    (nested_pair, 2, -1),
    (slider_crank, 1, -2),
    (planar_loop, 2, -1),
    (cardan, 1, -2),
    (spatial_slider, 2, 2),
    (bennett, 1, -2),
    (bricard, 1, 0),
    (floating_four_bar, 7, 4),
    (gear, 1, 1),
]


@pytest.mark.sweep
@pytest.mark.parametrize(
    ("make", "mobility", "gruebler"), MECHANISMS, ids=lambda x: getattr(x, "__name__", "")
)
def test_mobility_and_conservation_of_energy(make, mobility, gruebler):
    m, guess = make()
    system = m.assemble(guess=guess)
    assert system.closure.mobility == mobility
    assert system.closure.gruebler == gruebler
    assert system.closure.residual < 1e-11
    assert len(system.closure.rows) == system.nv - mobility
    kept = sum(len(row.rows) - len(row.dropped) for row in system.loops)
    assert kept == len(system.closure.rows)
    assert f"Mobility {mobility} (Gruebler-Kutzbach counts {gruebler})" in system.report()
    start = {system.velocity_coordinates[system.independent[0]].name: 0.5}
    run = mbs.simulate.run(system, duration=0.3, v0=start, step=0.05, quiet=True, tolerance=1e-9)
    T = np.array(run["kinetic_energy"])
    E = T + np.array(run["potential_energy"])
    assert np.ptp(E) < 1e-6 * max(1.0, T.max())
    assert np.abs(run["closure_residual"]).max() < 1e-10


def test_a_gear_follows():
    m, _ = gear()
    system = m.assemble()
    assert [(c.name, c.actuated) for c in system.coordinates] == [("j1", True), ("j2", False)]
    assert [system.velocity_coordinates[k].name for k in system.independent] == ["j1"]
    assert system.configuration[1] == pytest.approx(
        0.1 - 2 * system.configuration[0] + 0.3 * system.configuration[0] ** 2
    )
    assert system.loops[0].closing == "coupling"
    assert "Coupling ratio: j2 follows j1." in system.report()
    run = mbs.simulate.run(system, duration=0.2, v0={"j1": 1.0}, step=0.05, quiet=True)
    q1, q2 = np.array(run["j1.q"]), np.array(run["j2.q"])
    np.testing.assert_allclose(q2, 0.1 - 2 * q1 + 0.3 * q1**2, atol=1e-9)


def test_a_coupled_joint_stays_in_the_tree():
    m = four_bar()
    free = m.add(bar("d", 0.3))
    m.connect(m.components["b"].at(0.5), Revolute("k"), free.left)
    m.add(Coupling("gear", "k", "j3", (0, 2)))
    system = m.assemble(guess={"j2": 1.0})
    assert "j3" in names(system)
    assert system.closure.mobility == 1


def test_the_driver_of_a_cut_joint_is_of_no_use():
    m = four_bar()
    m.cut(m.components["j4"])
    m.add(Coupling("gear", "j4", "j1"))
    refused(
        AssemblyError, "gear: there is no coordinate 'j4' in the tree", "j1, j2, j3", by=m.assemble
    )


def test_rows_of_a_planar_loop_that_are_dropped():
    system = four_bar().assemble(guess={"j2": 1.0})
    row = system.loops[0]
    assert set(row.dropped) < set(row.rows)
    assert len(row.dropped) == 3
    text = system.report()
    assert "2 of 5 rows are independent" in text
    assert "the cut forces along them are not unique" in text
    assert "The loops close to" in text


def test_a_weld_can_be_cut():
    m = mbs.Mechanism("m")
    before = m.world
    for k, axis in enumerate("zxyzxyz"):
        body = m.add(solid(f"b{k}"))
        m.connect(before.at(0.4 if k else 0), Revolute(f"j{k}", axis=axis), body)
        before = body
    weld = Fixed("weld")
    m.connect(before.at(0.4), weld, m.world.at(0.5, 0.5, 0.4))
    m.cut(weld)
    system = m.assemble()
    assert cuts(system) == ["weld"]
    assert (len(system.loops[0].rows), system.closure.mobility) == (6, 1)


@pytest.mark.parametrize(
    ("make", "error", "parts"),
    [
        (
            lambda: four_bar((0.1, 0.2, 0.1)),
            Unclosable,
            ["m: the loop cannot be closed", "open by 0.4 m", "change lengths"],
        ),
    ],
    ids=["unclosable"],
)
def test_refused(make, error, parts):
    refused(error, *parts, by=lambda: make().assemble(guess={"j2": 1.0}))


@pytest.mark.parametrize("other", ["j2", "j4"])
def test_more_motors_than_the_mobility_are_all_kept(other):
    m = four_bar(j1={"actuated": True}, **{other: {"actuated": True}})
    system = m.assemble(guess={"j2": 1.0})
    names = [speed.name for speed in system.velocity_coordinates]
    assert [names[k] for k in system.motors] == ["j1", other]
    assert len(system.independent) == 1


def test_motors_that_depend_on_each_other():
    def carried(m):
        arm = m.add(solid("arm"))
        m.connect(m.world, Revolute("shoulder", actuated=False), arm)
        return arm

    m = four_bar(base=carried, j1={"actuated": True}, j4={"actuated": True})
    system = m.assemble(guess={"j2": 1.0})
    names = [speed.name for speed in system.velocity_coordinates]
    assert {names[k] for k in system.motors} == {"shoulder", "j1", "j4"}
    assert len(system.independent) == system.closure.mobility == 2
    assert names.index("shoulder") in system.independent


def test_no_motion_left():
    m = mbs.Mechanism("m")
    b = m.add(solid("b"))
    m.connect(m.world, Revolute("j1"), b)
    m.connect(m.world.at(1), Revolute("j2"), b.at(1))
    system = m.assemble()
    assert system.closure.mobility == 0
    assert system.independent == system.chosen_coordinates == ()
    assert "Mobility 0" in system.report()
    result = mbs.simulate.run(system, 0.1)
    np.testing.assert_allclose([result["j1.q"], result["j1.v"]], 0, atol=1e-12)


def test_unclosable_says_by_how_much():
    m = four_bar((0.1, 0.5, 0.1), ground=1.0)
    message = refused(Unclosable, "the best configuration found leaves", by=m.assemble)
    assert "open by 0.3 m" in message


def test_a_guess_of_a_cut_joint_is_accepted_and_a_wrong_name_refused():
    system = four_bar().assemble(guess={"j1": 0.2, "j2": 1.0, "j3": -1.8, "j4": 1.0})
    assert system.closure.mobility == 1
    refused(
        AssemblyError,
        "m: the guess names 'j5', which is no coordinate",
        "use one of j1, j2, j4, j3",
        by=lambda: four_bar().assemble(guess={"j5": 1.0}),
    )


def test_a_parallelogram_that_starts_flat_leaves_it():
    m = four_bar((0.5, 1.0, 0.5), ground=1.0)
    system = m.assemble()
    assert system.closure.mobility == 1
    q = np.array(system.configuration)
    from mbs.loops import closure_jacobian

    J = closure_jacobian(system)
    values = np.linalg.svd(
        np.array(J(q)) if J.n_in() == 1 else np.array(J(q, [])), compute_uv=False
    )
    assert values[1] > 1e-3 * values[0]


def three_legs():
    m = mbs.Mechanism("m", gravity=DOWN)
    top = m.add(bar("top", 1.0))
    for k in range(3):
        leg = m.add(bar(f"leg{k}", 0.5))
        m.connect(m.world.at(k / 2), Revolute(f"j{k}"), leg.left)
        m.connect(leg.right, Revolute(f"k{k}"), top.at(k / 2))
    return m, {"j0": 1.0, "j1": 1.0, "j2": 1.0, "k0": -1.0}


def test_a_parallelogram_with_three_legs_moves():
    m, guess = three_legs()
    assert m.assemble(guess=guess).closure.mobility == 1


def test_sr400_leaves_the_singular_configuration_of_its_guess():
    system = mbs.load("sr400").assemble(guess={f"q{k}": 0.0 for k in range(1, 9)})
    q = dict(zip(names(system), system.configuration, strict=True))
    assert abs(q["q2"] - q["q7"]) > 1e-2
