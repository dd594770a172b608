"""The mechanisms of benchmarks/loops.py for a moment: references, twins and mbs tell one motion."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from loops_cases import CASES, made, outputs, plain_of, run
from support.errors import rms_error

SECONDS = {"pendulum": 0.5, "n1": 0.5, "n2": 0.5, "andrews": 5e-3, "bricard": 0.5, "governor": 0.1}
each = pytest.mark.parametrize("name", SECONDS)


def case_of(name):
    return replace(CASES[name], seconds=SECONDS[name], rows=10)


@cache
def built(name):
    return made(case_of(name))


@cache
def reference(name):
    case = case_of(name)
    return case.reference(case.times)


@pytest.mark.sweep
@each
def test_mbs_and_reference_tell_one_motion(name):
    case = case_of(name)
    states = run(case, built(name), 1e-10, case.times)()
    values = outputs(case, built(name).system, states)
    assert np.ptp(values, axis=0).max() > 1e-4
    assert rms_error(values, reference(name)) < 1e-7


@each
def test_plain_numbers_are_those_of_the_mechanism(name):
    numbers = plain_of(case_of(name), built(name))
    energy = sum(
        body.mass * body.velocity @ body.velocity + body.spin @ body.inertia @ body.spin
        for body in numbers.bodies
    )
    observed = built(name).state.observe(0, built(name).x0, [])
    np.testing.assert_allclose(energy / 2, float(observed[-3]), rtol=1e-10)
    assert numbers.planar == (name not in ("bricard", "governor"))
    assert len(numbers.cuts) == len(built(name).system.cuts)


@each
def test_mujoco_twin(name):
    pytest.importorskip("mujoco")
    from mujoco_twins import MujocoTwin

    case = case_of(name)
    twin = MujocoTwin(plain_of(case, built(name)))
    step = min(case.steps.mujoco[1], 1e-3)
    places = twin.places(twin.run(step, case.seconds, case.rows))
    assert rms_error(places[:, case.axes], reference(name)) < 1e-3


@each
def test_exudyn_twin_converges_with_the_square_of_the_step(name):
    pytest.importorskip("exudyn")
    from exudyn_twins import ExudynTwin

    case = case_of(name)
    twin = ExudynTwin(plain_of(case, built(name)))
    errors = []
    for steps in (100, 200):
        places = twin.places(twin.run(case.seconds / steps, case.seconds, case.rows))
        errors.append(rms_error(places[:, case.axes], reference(name)))
    assert errors[1] < 0.05
    assert 3 < errors[0] / errors[1] < 5


def test_steps_must_fall_on_the_rows():
    pytest.importorskip("mujoco")
    from mujoco_twins import MujocoTwin

    case = case_of("pendulum")
    twin = MujocoTwin(plain_of(case, built("pendulum")))
    with pytest.raises(ValueError, match="15 steps do not fall on 10 rows"):
        twin.run(case.seconds / 15, case.seconds, case.rows)
