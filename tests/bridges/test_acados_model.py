"""Fields of an AcadosModel: the equations of the DAE, with a regular derivative."""

import casadi
import numpy as np
import pytest
from support.rod_mechanisms import acrobot, four_bar

from mbs.bridges import acados_fields
from mbs.errors import ModelError
from mbs.models import dae


@pytest.mark.parametrize(
    ("make", "form"),
    [(four_bar, "reduced"), (four_bar, "index1"), (acrobot, "reduced"), (acrobot, "ggl")],
)
def test_implicit_equations_are_zero_and_regular(make, form):
    model = dae(make(), form)
    f = acados_fields(model, "arm")
    assert f["name"] == "arm"
    given = [f[name] for name in ("x", "xdot", "u", "z", "p")]
    unknown = casadi.vertcat(f["xdot"], f["z"])
    rows = f["f_impl_expr"]
    both = casadi.Function("f", given, [rows, casadi.jacobian(rows, unknown)])
    rate = model.function()(model.x0, model.z0, model.u0, model.p0)[0]
    value, slope = both(model.x0, rate, model.u0, model.z0, model.p0)
    assert float(casadi.norm_inf(value)) < 1e-9
    assert slope.shape == (unknown.numel(), unknown.numel())
    assert np.linalg.cond(np.array(slope)) < 1e6
    assert ("f_expl_expr" in f) == (model.z.numel() == 0)


@pytest.mark.parametrize("form", ["index2", "index3", "ggl"])
def test_refuses_what_acados_does_not_integrate(form):
    with pytest.raises(ModelError, match=f"form '{form}' has .* takes 'reduced' and 'index1'"):
        acados_fields(dae(four_bar(), form))


@pytest.mark.parametrize("name", ["two words", "", "a__b", 3])
def test_refuses_names_that_do_not_serve_in_c(name):
    with pytest.raises(ModelError, match=r"name is .*; use letters, digits"):
        acados_fields(dae(acrobot()), name)


def test_refuses_what_is_no_dae():
    with pytest.raises(ModelError, match=r"is not a Dae; give mbs\.models\.dae\(system\)"):
        acados_fields(acrobot())
