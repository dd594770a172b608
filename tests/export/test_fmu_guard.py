"""FMUs whose states lose their hold on the dependent coordinates say so, and never leap."""

import casadi as ca
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmu_instances import Fmu

from mbs.export.fmu.description import FmuModel, FmuState, FmuVariable
from mbs.export.fmu.pack import write_fmu


def bent(change, rows=None):
    """x follows time; the velocity of z = x changes by `change` of its size at x = 0.5."""
    t, x, z, u, p = (ca.SX.sym(k, n) for k, n in zip("txzup", (1, 1, 1, 0, 0), strict=True))
    v = 1.0 + ca.if_else(x > 0.5, change, 0.0)
    residual = z - x
    step = ca.Function("closure", [x, z, p], [x, ca.fabs(residual)])
    rows = ca.Function("slopes", [x, z, p], [ca.SX(1.0) if rows is None else rows(x)])
    return FmuModel(
        name="bent",
        states=(FmuState(name="x", output=True),),
        outputs=(FmuVariable(name="v"), FmuVariable(name="a")),
        dependents=(FmuVariable(name="z"),),
        rhs=ca.Function("rhs", [t, x, z, u, p], [ca.SX(1.0), ca.vertcat(v, 0.0)]),
        closure=step,
        slopes=rows,
        passive=(0, 1, 1),
    )


def stepped(model, folder):
    """Where steps of 0.1 end; None where they all go."""
    made = Fmu(write_fmu(model, folder / "bent.fmu"), folder / "bent")
    instance = made.open(FMU2Slave)
    try:
        for k in range(10):
            instance.doStep(0.1 * k, 0.1)
    except FMICallException:
        return instance.getRealStatus(2)
    finally:
        instance.freeInstance()
    return None


@pytest.mark.parametrize(("change", "stops"), [(0.0, False), (0.1, False), (1.0, True)])
def test_a_kink_of_velocities_stops_the_motion(change, stops, tmp_path):
    end = stepped(bent(change), tmp_path)
    assert (end is not None) == stops
    assert end is None or 0.5 <= end < 0.8


def test_a_determinant_that_changes_its_sign_stops_the_motion(tmp_path):
    assert 0.5 <= stepped(bent(0.0, lambda x: 0.5 - x), tmp_path) < 0.8
