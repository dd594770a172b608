"""The energy model against energy and power."""

import numpy as np
import pytest
from support.regressor_states import (
    CLOSED,
    OPEN,
    ROTORS,
    TREES,
    Motion,
    state_of,
    system_of,
)
from symbolic_robots import symbolic_robot

import mbs.models
from mbs.identification import energy_regressor, numeric_parameters, power_regressor, regressor
from mbs.operations import count

EVERY = (*OPEN, *CLOSED, *TREES, *ROTORS)
BOUNDS = {"puma560": "131/70", "rx90": "109/54", "iiwa": "132/67"}


@pytest.mark.sweep
@pytest.mark.parametrize("name", [name for name in EVERY if name != "andrews_squeezer"])
def test_energy_of_a_system_without_springs(name):
    system = system_of(name)
    q, v, _ = state_of(system)
    h = energy_regressor(system)
    E, U = mbs.models.energy(system)(q, v)
    found = float(np.array(h(q, v)).ravel() @ numeric_parameters(system, h.columns))
    assert found == pytest.approx(float(E + U), rel=1e-12, abs=1e-12)


@pytest.mark.sweep
@pytest.mark.parametrize("name", EVERY)
def test_its_rate_is_the_power_of_the_efforts(name):
    system = system_of(name)
    options = {"offsets": True, "couplings": [(1, 2)] if name == "puma560" else []}
    motion = Motion(system)
    q, v, a = motion.q, motion.v, motion.a
    power = v.T @ regressor(system, **options)(q, v, a)
    taken = power_regressor(system, **options)(q, v)
    rate = motion.rate(energy_regressor(system, **options)(q, v))
    state = state_of(system)
    assert motion.largest(rate + taken - power, state) < 1e-12 * motion.largest(power, state)


def test_friction_stores_nothing_and_inertia_takes_nothing():
    system = system_of("puma560")
    h, P = energy_regressor(system), power_regressor(system)
    dissipating = np.array([column.kind in ("Fv", "Fs") for column in h.columns])
    assert not h.effective[dissipating].any()
    assert P.effective.tolist() == dissipating.tolist()


@pytest.mark.parametrize("name", BOUNDS)
def test_it_takes_no_more_operations(name):
    system = symbolic_robot(name).assemble()
    found = count(energy_regressor(system, rotors=False, friction=False))
    mul, add = (int(part) for part in BOUNDS[name].split("/"))
    assert (found.mul <= mul, found.add <= add) == (True, True), str(found)
