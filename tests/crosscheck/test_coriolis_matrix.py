"""B of Lagrange's form against the Coriolis matrix of pinocchio, on catalogue robots."""

import numpy as np
import pytest
from crosscheck.test_pinocchio import ROBOTS, pin, twin

import mbs
import mbs.models


@pytest.mark.sweep
@pytest.mark.parametrize("method", ["renaud", "christoffel"])
@pytest.mark.parametrize("name", ROBOTS)
def test_coriolis_matrix(name, method):
    mechanism = mbs.load(name)
    system = mechanism.assemble()
    model, _ = twin(mechanism)
    rng = np.random.default_rng(3)
    q, v = rng.uniform(-2, 2, (2, system.nv))
    expected = pin.computeCoriolisMatrix(model, model.createData(), q, v)
    B = np.array(mbs.models.lagrange(system, method)(q, v)[1])
    np.testing.assert_allclose(B, expected, rtol=0, atol=1e-11 * max(1, np.abs(expected).max()))
