"""Studies are told apart by their models, cases and options."""

import numpy as np
import pytest

from mbs import robots
from mbs.simulate.sweep_identity import study_of


@pytest.fixture(scope="module")
def system():
    return robots.cart_pole().assemble()


def test_long_tables_among_the_options_are_told_apart(system, tmp_path):
    tables = [np.array([[0.3]]), np.array([[0.4]])]
    assert study_of(system, (), {"x": tables[0]}) == study_of(system, (), {"x": tables[0].copy()})
    assert study_of(system, (), {"x": tables[0]}) != study_of(system, (), {"x": tables[1]})
    long = [np.zeros(5000), np.zeros(5000)]
    long[1][2500] = 1.0
    nested = [study_of(system, (), {"inputs": {"tau": (one, one)}}) for one in long]
    assert nested[0] != nested[1]


def test_functions_are_told_by_name_and_objects_without_their_address(system):
    def torque(t):
        return t

    told = study_of(system, (), {"x": {"a": torque}, "y": object()})["options"]
    assert told["x"].endswith("torque}")
    assert told["y"] == "<object object>"


def test_laws_are_told_by_what_they_say(system):
    name = system.velocity_coordinates[0].name

    def study(factor):
        def torque(t, q, v):
            return {name: factor * t}

        return study_of(system, (), {"tau": torque})

    assert study(1.0) == study(1.0)
    assert study(1.0)["content"] != study(1 + 1e-15)["content"]
