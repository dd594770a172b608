"""Symbols of force elements as columns: stiffness, damping and what a user's own law has."""

import casadi
import numpy as np
from support.messages import refused

import mbs
from mbs import identification as ident
from mbs.components import Box, Custom, JointFriction, Revolute, Spring, custom
from mbs.errors import ModelError

LAWS = ("k", "c", "drag", "viscous")


class Drag(Custom):
    """A force against the velocity of a point, linear in its coefficient."""

    point = custom.frame()
    c = custom.parameter("kg/m", min=0)

    def loads(self, at):
        v = at.point.v
        return {"point": custom.force(-at.c * casadi.sqrt(casadi.dot(v, v) + 1e-12) * v)}


def arm():
    m = mbs.Mechanism("arm", gravity=(0, -9.81, 0))
    first, second = m.add(Box("a", length=0.5, mass=2.0)), m.add(Box("b", length=0.4, mass=1.0))
    m.connect(m.world, Revolute("j1", axis="z", actuated=True), first.left)
    m.connect(first.right, Revolute("j2", axis="z", actuated=True), second.left)
    k, c, drag, viscous, length = (
        mbs.Parameter(name, value, unit=unit)
        for name, value, unit in (
            ("k", 80.0, "N/m"),
            ("c", 3.0, "N.s/m"),
            ("drag", 0.7, "kg/m"),
            ("viscous", 0.2, "N.m.s/rad"),
            ("L0", 0.3, "m"),
        )
    )
    m.add(Spring("spring", m.world.at(0.2, 0.8, 0), second.right, k, length, c))
    m.add(Drag("air", second.right, drag))
    m.add(JointFriction("oil", "j2", viscous=viscous))
    return m.assemble()


def states(count=5):
    return np.random.default_rng(5).uniform(-1, 1, (count, 3, 2))


def test_columns_times_values_are_the_efforts():
    system = arm()
    D = ident.regressor(system, laws=LAWS)
    assert [c.name for c in D.columns[-4:]] == list(LAWS)
    assert [c.unit for c in D.columns[-4:]] == ["N/m", "N.s/m", "kg/m", "N.m.s/rad"]
    K = ident.regressors.numeric_parameters(system, D.columns)
    known = ident.known_efforts(system, laws=LAWS)
    idm = mbs.models.inverse_dynamics(system)
    for q, v, a in states():
        whole = np.array(D(q, v, a)) @ K + np.array(known(q, v)).ravel()
        np.testing.assert_allclose(whole, np.array(idm(q, v, a)).ravel(), rtol=1e-12, atol=1e-12)
        assert np.abs(np.array(known(q, v))).max() < 1e-12  # all laws are linear in the symbols
        other = K.copy()
        other[-4:] *= [1.3, 0.2, 3.0, 2.0]
        p = [
            dict(zip(LAWS, other[-4:], strict=True)).get(x.name, x.default)
            for x in system.parameters
        ]
        np.testing.assert_allclose(
            np.array(D(q, v, a)) @ other, np.array(idm(q, v, a, p)).ravel(), rtol=1e-12, atol=1e-12
        )


def test_power_of_the_efforts_is_the_rate_of_the_energy_and_what_is_lost():
    system = arm()
    h, P = (f(system, laws=LAWS) for f in (ident.energy_regressor, ident.power_regressor))
    D1D2 = ident.filtered_regressor(system, laws=LAWS)
    D = ident.regressor(system, laws=LAWS)
    for q, v, a in states():
        ahead, behind = (
            np.array(h(q + t * v + t * t * a / 2, v + t * a)).ravel() for t in (1e-4, -1e-4)
        )
        rate = (ahead - behind) / 2e-4
        power = v @ np.array(D(q, v, a))
        np.testing.assert_allclose(power, rate + np.array(P(q, v)).ravel(), rtol=1e-6, atol=1e-6)
        _, D2 = D1D2(q, v)
        np.testing.assert_allclose(np.array(D2)[:, -4:], np.array(D(q, v, a))[:, -4:], atol=1e-12)


def test_base_parameters_and_estimates_have_them():
    system = arm()
    D = ident.regressor(system, laws=("k", "drag"))
    rows, right = [], []
    rng = np.random.default_rng(8)
    K = ident.regressors.numeric_parameters(system, D.columns)
    for _ in range(60):
        q, v, a = rng.uniform(-2, 2, (3, 2))
        rows.append(np.array(D(q, v, a)))
        right.append(np.array(D(q, v, a)) @ K)
    W, y = np.vstack(rows), np.concatenate(right)
    found = np.linalg.lstsq(W, y, rcond=1e-10)[0]
    np.testing.assert_allclose(found[-2:], [80.0, 0.7], rtol=1e-9)


def test_what_is_refused():
    system = arm()
    regressor, energy = ident.regressor, ident.energy_regressor
    assert regressor(system, laws=("L0",)).columns[-1].unit == "m"
    refused(ModelError, "names 'stiff'", by=lambda: regressor(system, laws=("stiff",)))
    refused(ModelError, "'k' and 'L0' together", by=lambda: regressor(system, laws=("k", "L0")))
    refused(ModelError, "not linear in 'L0'", by=lambda: energy(system, laws=("L0",)))


def test_a_symbol_of_bodies_is_no_law():
    m = mbs.Mechanism("bar")
    bar = m.add(Box("bar", length="L", mass=1.0))
    m.connect(m.world, Revolute("j", axis="y"), bar.left)
    m.add(Spring("s", m.world.at(0, 0, 1), bar.right, "L", 0.2))
    m.values["L"] = mbs.Parameter("L", 0.4)
    refused(ModelError, "components alone", by=lambda: ident.regressor(m.assemble(), laws=("L",)))
