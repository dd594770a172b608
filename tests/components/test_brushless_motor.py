"""Brushless motors in dq coordinates: power, steady state, control of currents."""

import numpy as np
import pytest
from support.everywhere import agree
from support.messages import refused

import mbs
from mbs.components import PI, BLDCMotor, Constant, ShaftDamper, ShaftInertia
from mbs.errors import DescriptionError

NUMBERS = {
    "pole_pairs": 4,
    "resistance": 0.4,
    "inductance_d": 1.2e-3,
    "inductance_q": 2.0e-3,
    "flux": 0.015,
    "inertia": 2e-4,
}


def spindle(damping=0.0, **changed):
    m = mbs.Mechanism("spindle")
    motor = m.add(BLDCMotor("motor", **(NUMBERS | changed)))
    m.connect(motor.flange, ShaftInertia("wheel", 3e-3).flange_a)
    if damping:
        m.connect(motor.flange, ShaftDamper("bearing", damping).flange)
    return m, motor


def test_power_balance():
    m, _ = spindle()
    result = mbs.simulate.run(
        m.assemble(), 0.2, u={"motor.v_d": -2.0, "motor.v_q": 9.0}, step=1e-5, tolerance=1e-12
    )
    i_d, i_q, w = result["motor.i_d"], result["motor.i_q"], result["motor.w"]
    power = result["motor.power"]
    assert np.abs(power - 1.5 * (-2 * i_d + 9 * i_q)).max() < 1e-12
    copper = 1.5 * 0.4 * (i_d**2 + i_q**2)
    magnetic = 0.75 * (1.2e-3 * i_d**2 + 2e-3 * i_q**2)
    stored = magnetic + 0.5 * 3.2e-3 * w**2

    def work(p):  # Simpson's rule, h^4 = 1e-20
        return (p[:-2:2] + 4 * p[1:-1:2] + p[2::2]).sum() * 1e-5 / 3

    assert stored[-1] > 1.0
    assert abs(work(power) - work(copper) - stored[-1] + stored[0]) < 1e-8 * stored[-1]
    assert abs(work(result["motor.tau"] * w) - 0.5 * 3.2e-3 * w[-1] ** 2) < 1e-8 * stored[-1]


def test_power_balance_at_an_instant():
    m, _ = spindle()
    system = m.assemble()
    tau, rates, y = mbs.models.devices(system)([70.0], [3.0, -5.0], [4.0, 11.0])
    i, di, L = np.array([3.0, -5.0]), np.array(rates)[:, 0], np.array([1.2e-3, 2e-3])
    power = 1.5 * (4 * 3 - 11 * 5)
    stored = 1.5 * np.sum(L * i * di)
    assert abs(power - 1.5 * 0.4 * np.sum(i**2) - stored - float(tau) * 70) < 1e-8
    assert float(tau) == pytest.approx(6 * (0.015 * -5 + (1.2e-3 - 2e-3) * 3 * -5), rel=1e-14)
    assert np.array(y)[:, 0] == pytest.approx([float(tau), 70.0, power])


def test_everywhere(tmp_path):
    m, _ = spindle(damping=2e-3)
    shown = ["wheel.q", "motor.i_d", "motor.i_q", "motor.power"]
    start = {"u": {"motor.v_d": -2.0, "motor.v_q": 9.0}, "z0": {"motor.i_q": 3.0}}
    agree(m.assemble(), tmp_path, 0.1, shown, **start)


def test_steady_state():
    m, _ = spindle(damping=2e-3)
    result = mbs.simulate.run(
        m.assemble(),
        30.0,
        u={"motor.v_d": 0.0, "motor.v_q": 9.0},
        step=1.0,
        method="rodas",
        tolerance=1e-9,
    )
    w, i_d, i_q = (result[f"motor.{name}"][-1] for name in ("w", "i_d", "i_q"))
    # 0 = v_d - R i_d + P w L_q i_q, 0 = v_q - R i_q - P w (L_d i_d + psi), torque = damping w
    assert abs(0.4 * i_d - 4 * w * 2e-3 * i_q) < 1e-6
    assert abs(9 - 0.4 * i_q - 4 * w * (1.2e-3 * i_d + 0.015)) < 1e-6
    assert abs(6 * (0.015 * i_q - 0.8e-3 * i_d * i_q) - 2e-3 * w) < 1e-8
    assert w > 50


def test_one_inductance_is_a_dc_motor_along_q():
    m, motor = spindle(inductance_q=None)
    hold = PI("hold", kp=20.0, ki=4000.0)
    zero = Constant("zero", 0.0)
    m.connect_signal("motor.i_d", hold.measured)
    m.connect_signal(zero.y, hold.target)
    m.connect_signal(hold.u, motor.v_d)
    result = mbs.simulate.run(
        m.assemble(), 0.1, u={"motor.v_q": 5.0}, step=1e-3, method="rodas", tolerance=1e-9
    )
    i_q, torque = result["motor.i_q"], result["motor.tau"]
    assert np.abs(torque - 6 * 0.015 * i_q).max() < 1e-12
    assert np.abs(result["motor.i_d"]).max() < 0.05 * i_q.max()


@pytest.mark.parametrize(
    "name", ["pole_pairs", "resistance", "inductance_d", "inductance_q", "flux"]
)
def test_numbers_that_are_refused(name):
    refused(
        DescriptionError, "motor", f"{name} is 0", "more than zero", by=lambda: spindle(**{name: 0})
    )
