"""The solvers of co-simulation inside an FMU."""

import dataclasses
import xml.etree.ElementTree as ET

import casadi as ca
import fmpy
import numpy as np
import pytest
from fmu_models import pendulum, slider_crank

from mbs.errors import ExportError
from mbs.export.fmu.description import FmuModel, FmuState, FmuVariable
from mbs.export.fmu.pack import write_fmu
from mbs.export.fmu.xml import model_description

MODELS = {"pendulum": pendulum, "slider_crank": slider_crank}


def stiff():
    """A state that is pulled to cos(t) a million times faster than it moves there."""
    t, x, u, p, z = (ca.SX.sym(name, n) for name, n in zip("txupz", (1, 1, 0, 1, 0), strict=True))
    xdot = -p * (x - ca.cos(t)) - ca.sin(t)
    return FmuModel(
        name="stiff",
        states=(FmuState(name="x", start=1.0, output=True, description="state"),),
        parameters=(FmuVariable(name="rate", unit="1/s", start=1e6, description="how fast"),),
        rhs=ca.Function("rhs", [t, x, z, u, p], [xdot, ca.SX(0, 1)]),
    )


def run(model, folder, fmi="2.0", **options):
    path = write_fmu(model, folder / f"{model.solver}{fmi}.fmu", fmi=fmi)
    options = {"stop_time": 1.0, "output_interval": 0.1, "relative_tolerance": 1e-10, **options}
    rows = fmpy.simulate_fmu(str(path), fmi_type="CoSimulation", **options)
    return np.array([list(row) for row in rows])


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_the_implicit_solver_agrees_with_the_explicit_one(name, fmi, tmp_path):
    model = MODELS[name]()
    explicit = run(model, tmp_path, fmi)
    implicit = run(dataclasses.replace(model, solver="rodas"), tmp_path, fmi)
    assert np.allclose(implicit, explicit, rtol=1e-7, atol=1e-8)
    assert not np.array_equal(implicit, explicit)


def test_the_implicit_solver_takes_stiff_equations(tmp_path):
    rows = run(dataclasses.replace(stiff(), solver="rodas"), tmp_path, relative_tolerance=1e-8)
    assert np.allclose(rows[:, 1], np.cos(rows[:, 0]), atol=1e-9)


@pytest.mark.parametrize("name", MODELS)
def test_the_fixed_step_has_order_four(name, tmp_path):
    model = MODELS[name]()
    exact = run(model, tmp_path, relative_tolerance=1e-12)
    errors = []
    for step in (0.02, 0.01):
        fixed = dataclasses.replace(model, solver="rk4", internal_step=step)
        errors.append(np.abs(run(fixed, tmp_path) - exact)[:, 1:].max())
    assert errors[0] < 1e-3
    assert 10 < errors[0] / errors[1] < 24


def test_communication_steps_need_not_be_multiples_of_the_fixed_step(tmp_path):
    model = dataclasses.replace(pendulum(), solver="rk4", internal_step=0.007)
    odd = run(model, tmp_path, output_interval=0.05)
    exact = run(pendulum(), tmp_path, output_interval=0.05)
    assert np.allclose(odd, exact, atol=1e-6)


def test_a_solver_that_is_not_there():
    with pytest.raises(ExportError, match="solver is 'euler'; use dopri5 or rodas or rk4"):
        dataclasses.replace(pendulum(), solver="euler")
    with pytest.raises(ExportError, match="internal step 0 must be positive"):
        dataclasses.replace(pendulum(), internal_step=0)


@pytest.mark.parametrize("solver", ["dopri5", "rodas", "rk4"])
def test_the_fixed_step_is_stated_where_there_is_one(solver):
    """In FMI 3.0; the schema of 2.0 has no attribute for it."""
    model = dataclasses.replace(pendulum(), solver=solver, internal_step=0.002)
    root = ET.fromstring(model_description(model, "3.0", "{token}"))
    stated = root.find("CoSimulation").get("fixedInternalStepSize")
    assert stated == ("0.002" if solver == "rk4" else None)
    assert "fixedInternalStepSize" not in model_description(model, "2.0", "{guid}")
