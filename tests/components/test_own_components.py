"""The components of docs/own_components.md: in `run`, in `dae` with SUNDIALS, and as FMUs."""

import contextlib
from pathlib import Path

import casadi
import numpy as np
import pytest
from support.everywhere import agree, by_dae, by_run
from support.page import run as run_page

import mbs

PAGE = Path(__file__).parents[2] / "docs" / "own_components.md"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The names of the page when it has run."""
    names = {"__name__": "page"}
    with contextlib.chdir(tmp_path_factory.mktemp("page")):
        run_page(PAGE, names)
    return names


class TestDrag:
    def test_everywhere(self, page, tmp_path):
        result = agree(page["falling"], tmp_path, 1.5, ["z.q", "z.v", "z.a"], v0={"z": -0.1})
        assert result["z.v"][-1] < -8

    def test_terminal_velocity(self, page):
        # after 20 s it lacks 2 exp(-2 g t / v) of it, 2e-14
        end = by_run(page["falling"], 20.0)["z.v"][-1]
        assert abs(end + np.sqrt(0.3 * 9.81 / 0.02)) < 1e-10
        end = mbs.simulate.run(page["falling"], 20.0, parameters={"C": 0.08}, quiet=True)["z.v"][-1]
        assert abs(end + np.sqrt(0.3 * 9.81 / 0.08)) < 1e-7

    def test_derivatives_at_rest(self, page):
        ddm = mbs.models.direct_dynamics(page["falling"])
        slope = casadi.Function(
            "slope", [v := casadi.SX.sym("v")], [casadi.jacobian(ddm(0, v, 0, 0.02), v)]
        )
        assert float(slope(0.0)) == pytest.approx(0, abs=1e-12)
        assert float(slope(3.0)) == pytest.approx(2 * 0.02 / 0.3 * -3, rel=1e-12)


class TestMagnets:
    def test_everywhere(self, page, tmp_path):
        agree(page["pole"], tmp_path, 1.0, ["ball.qw.q", "ball.wx.v"], v0={"ball.wz": 1.0})

    def test_energy(self, page):
        result = mbs.simulate.run(
            page["pole"], 5.0, v0={"ball.wz": 1.0}, tolerance=1e-11, quiet=True
        )
        energy = result["kinetic_energy"] + result["potential_energy"]
        assert np.ptp(energy) < 1e-9 * np.ptp(result["kinetic_energy"])

    def test_forces_are_the_slopes_of_the_energy(self, page):
        # at the zero orientation the pole is at (0.4, 0, 0), the other one at (0.3, 0.1, -0.4)
        away = np.array([0.3, 0.1, -0.4]) - [0.4, 0, 0]
        L = np.linalg.norm(away)
        force = 0.6 / (L + 0.05) ** 2 * away / L
        moment = np.cross([0.4, 0, 0], force) + np.cross([0.2, 0, 0], [0, 0, -0.5 * 9.81])
        held = mbs.models.inverse_dynamics(page["pole"])([1, 0, 0, 0], np.zeros(3), np.zeros(3))
        assert np.array(held)[:, 0] == pytest.approx(-moment, rel=1e-12, abs=1e-12)


class TestRam:
    def test_everywhere(self, page, tmp_path):
        shown = ["z.q", "ram.p", "ram.force"]
        start = {"u": {"ram.flow": 1e-4}, "z0": {"ram.p": 6e5}}
        result = agree(page["lift"], tmp_path, 0.4, shown, **start)
        assert np.ptp(result["ram.p"]) > 1e4

    def test_spring_of_the_oil(self, page):
        # small swings about p = weight / area: w^2 = bulk A^2 / (V m)
        lift, p = page["lift"], 50 * 9.81 / 1e-3
        result = mbs.simulate.run(
            lift, 1.0, v0={"z": 1e-5}, z0={"ram.p": p}, tolerance=1e-14, quiet=True
        )
        w = np.sqrt(2e7 * 1e-6 / (6e-4 * 50))
        # the volume changes by 4e-7 / 0.6 of itself, and the swing with it
        assert np.abs(result["z.q"] - 1e-5 / w * np.sin(w * result.time)).max() < 1e-5 * 1e-5 / w

    def test_a_steady_flow_lifts_steadily(self, page):
        result = by_run(
            page["lift"], 2.0, v0={"z": 0.1}, u={"ram.flow": 1e-4}, z0={"ram.p": 50 * 9.81 / 1e-3}
        )
        assert np.abs(result["z.v"] - 0.1).max() < 1e-10
        assert np.abs(result["ram.force"] - 50 * 9.81).max() < 1e-7


class TestHelix:
    def test_everywhere(self, page, tmp_path):
        result = agree(page["helix"], tmp_path, 1.0, ["c.s.q", "c.phi.q"], v0={"c.phi": 2.0})
        lead = 0.3 / (2 * np.pi)
        assert np.abs(result["c.s.q"] - lead * result["c.phi.q"]).max() < 1e-13

    def test_as_the_built_in_screw(self, page):
        for form in ("reduced", "index1"):
            ends = [by_dae(page[s], form, 1.0, v0={"c.phi": 2.0}) for s in ("helix", "other")]
            # a polynomial has a closed form, of which c.s.q is no state
            both = set(ends[0]) & set(ends[1])
            assert {"c.phi.q", "c.phi.v"} <= both
            for name in both:
                assert ends[0][name] == pytest.approx(ends[1][name], rel=1e-11)
        one, two = (mbs.models.inverse_dynamics(page[s]) for s in ("helix", "other"))
        q = mbs.loops.solve(page["helix"], {"c.phi": 0.7})
        assert float(one(q, 0.3, 0.2)) == pytest.approx(float(two(q, 0.3, 0.2)), rel=1e-14)

    def test_hand_formula(self, page):
        lead = 0.3 / (2 * np.pi)
        falls = 9.81 * 0.8 / (0.8 + 2e-3 / lead**2)
        result = by_run(page["helix"], 1.0)
        assert np.abs(result["c.s.a"] + falls).max() < 1e-12


class TestRope:
    def test_everywhere(self, page, tmp_path):
        result = agree(page["rope"], tmp_path, 0.5, ["z2.q", "rope.tension"], v0={"z1": 0.3})
        assert np.abs(result["rope.tension"] - 2 * 2 * 3 / 5 * 9.81).max() < 1e-9
        assert np.abs(result["z1.a"] - 9.81 / 5).max() < 1e-11

    def test_the_tension_is_the_effort_of_the_row(self, page):
        rope = page["rope"]
        ddm = mbs.models.direct_dynamics(rope, coordinates="tree")
        a, lam = ddm(rope.configuration, [0.3, -0.3], [0, 0])
        assert np.array(a)[:, 0] == pytest.approx([9.81 / 5, -9.81 / 5], rel=1e-13)
        assert float(lam) == pytest.approx(-23.544, rel=1e-13)

    def test_rope_that_is_not_vertical(self, page):
        # pulled aside: only the component along the rope counts
        m = mbs.Mechanism("aside", gravity=(0, 0, -9.81))
        Body, Prismatic = mbs.components.Body, mbs.components.Prismatic
        one, two = m.add(Body("one", mass=2.0)), m.add(Body("two", mass=3.0))
        m.connect(m.world.at(3, 0, 0), Prismatic("z1", axis="z", actuated=False), one)
        m.connect(m.world.at(1, 0, 0), Prismatic("z2", axis="z", actuated=False), two)
        ends = m.world.at(0, 0, 4), m.world.at(1, 0, 4)
        m.add(page["Rope"]("rope", one, *ends, two, length=5 + 1 + 4))
        result = mbs.simulate.run(m.assemble(), 0.1, tolerance=1e-11, quiet=True)
        # at rest 5 L1' = 4 (4 - z1) ..: L1' = -0.8 z1', L2' = -z2'; z2' = -0.8 z1'
        tension = result["rope.tension"][0]
        a1, a2 = result["z1.a"][0], result["z2.a"][0]
        assert 2 * a1 == pytest.approx(0.8 * tension - 2 * 9.81, rel=1e-12)
        assert 3 * a2 == pytest.approx(tension - 3 * 9.81, rel=1e-12)
        assert a2 == pytest.approx(-0.8 * a1, rel=1e-12)


class TestPlanetary:
    def test_everywhere(self, page, tmp_path):
        shown = ["load.q", "ring.v", "motor.i", "motor.tau", "gear.mesh"]
        agree(page["drive"], tmp_path, 0.5, shown, u={"motor.voltage": 12.0}, z0={"motor.i": 3.0})

    def test_start_from_rest(self, page):
        # torques at the mesh are as 1 : k : -(1 + k); k = 2.5
        result = by_run(page["drive"], 0.01, z0={"motor.i": 3.0})
        softness = 1 / 1e-4 + 2.5**2 / 0.05 + 3.5**2 / 0.02
        mesh = -0.3 / 1e-4 / softness
        assert result["gear.mesh"][0] == pytest.approx(mesh, rel=1e-10)
        assert result["motor.rotor.a"][0] == pytest.approx((0.3 + mesh) / 1e-4, rel=1e-8)
        assert result["ring.a"][0] == pytest.approx(2.5 * mesh / 0.05, rel=1e-10)
        assert result["load.a"][0] == pytest.approx(-3.5 * mesh / 0.02, rel=1e-10)

    def test_steady_speed_with_the_carrier_free(self, page):
        # nothing brakes the carrier: the ring stands at the end
        result = mbs.simulate.run(
            page["drive"], 60.0, u={"motor": 12.0}, step=1.0, method="rodas", quiet=True
        )
        w = result["motor.rotor.v"][-1]
        assert abs(w - 12 / 0.1) < 1e-5
        assert abs(result["load.v"][-1] - w / 3.5) < 1e-6
        assert abs(result["ring.v"][-1]) < 1e-6


class TestServo:
    def test_everywhere(self, page, tmp_path):
        shown = ["elbow.q", "position.u", "current.u", "motor.i", "motor.tau", "encoder.q"]
        start = {"u": {"position.target": 0.5}, "z0": {"motor.i": 1.0, "position.x": -0.5}}
        result = agree(page["servo"], tmp_path, 0.3, [*shown[:-1], "position.f"], **start)
        assert np.all(result["encoder.q"] == result["elbow.q"])


class TestBelt:
    """Its formulas stand on the page."""

    @pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
    def test_an_fmu_does_what_run_does(self, page, tmp_path, kind):
        start = {"one.v": 30.0, "two.v": -5.0}
        v0 = {name.removesuffix(".v"): value for name, value in start.items()}
        here = mbs.simulate.run(
            page["drums"], 1.0, v0=v0, u={"motor": 3.0}, tolerance=1e-10, quiet=True
        )
        assert [what for *_, what in here.events] == ["belt sticks"]
        path = mbs.export.fmu(page["drums"], tmp_path / "belt.fmu")
        inputs = {"motor.tau": 3.0}
        there = mbs.simulate.fmu(
            path, 1.0, start=start, inputs=inputs, kind=kind, step=0.01, tolerance=1e-10, quiet=True
        )
        for name in ("one.v", "two.v", "one.q", "two.q"):
            assert abs(there[name][-1] - here[name][-1]) < 1e-7
        assert there["drive.belt.mode"][-1] == 0
        assert there["drive.belt.effort"][-1] == pytest.approx(here["drive.belt.effort"][-1])
