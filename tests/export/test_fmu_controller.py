"""Mechanisms driven by a controller inside the FMU."""

import casadi as ca
import fmpy
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.components import Body, DCMotor, Revolute
from mbs.errors import CompilerError, ExportError, ModelError
from mbs.export import CController
from mbs.export.fmu.options import FmuOptions
from mbs.export.fmu.system_fmu import fmu_model
from mbs.solvers import integrate

TENSOR = ((0.02, 0, 0), (0, 0.03, 0), (0, 0, 0.04))
LAW = """
#include "gains.h"
void pd(double t, const double *q, const double *v, const double *w, double *tau) {
    for (int k = 0; k < 2; ++k) tau[k] = KP * (w[k] - q[k]) - KD * v[k] * (1 + v[k] * v[k]);
    tau[0] += t;
}
void pd_slopes(double t, const double *q, const double *v, const double *w, double *J) {
    for (int i = 0; i < 14; ++i) J[i] = 0;
    J[0] = 1;
    for (int k = 0; k < 2; ++k) {
        J[2 + 3 * k] = -KP;
        J[6 + 3 * k] = -KD * (1 + 3 * v[k] * v[k]);
        J[10 + 3 * k] = KP;
    }
}
"""


def arm():
    m = mbs.Mechanism("arm", gravity=(0, -9.81, 0))
    a, b = (m.add(Body(n, mass=1.0, com=(0.2, 0, 0), inertia=TENSOR)) for n in "ab")
    m.connect(m.world, Revolute("j1", axis="z"), a)
    m.connect(a.at(0.4), Revolute("j2", axis="z"), b)
    return m.assemble()


def pd(t, q, v, q_ref=(0.7, -0.4)):
    tau = 30 * (ca.vertcat(*ca.vertsplit(ca.SX(q_ref))) - q) - 4 * v * (1 + v**2)
    return tau + ca.vertcat(t, 0)


def pd_function():
    t, q, v, w = (ca.SX.sym(n, k) for n, k in (("t", 1), ("q", 2), ("v", 2), ("q_ref", 2)))
    tau = 30 * (w - q) - 4 * v * (1 + v**2) + ca.vertcat(t, 0)
    return ca.Function("pd", [t, q, v, w], [tau], ["t", "q", "v", "q_ref"], ["tau"])


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sources")
    (folder / "controller.c").write_text(LAW)
    (folder / "gains.h").write_text("#define KP 30.0\n#define KD 4.0\n")
    return [folder / "controller.c", folder / "gains.h"]


def run(path, **inputs):
    return mbs.simulate.fmu(path, 0.5, step=0.05, inputs=inputs, tolerance=1e-10, quiet=True)


def test_a_python_law_moves_the_arm_as_in_a_simulation(tmp_path) -> None:
    path = mbs.export.fmu(arm(), tmp_path / "arm.fmu", controller=pd)
    own = mbs.simulate.run(arm(), 0.5, tau=pd, step=0.05, tolerance=1e-10, quiet=True)
    fmu = run(path)
    assert not [
        v for v in fmpy.read_model_description(path).modelVariables if v.causality == "input"
    ]
    for name in ("j1.q", "j2.q", "j1.v", "j1.a", "j2.tau"):
        assert np.abs(fmu[name] - own[name]).max() < 1e-7 * (1 + np.abs(own[name]).max()), name


@pytest.mark.parametrize("jacobian", [None, "pd_slopes"])
def test_a_law_in_c_moves_the_arm_as_its_casadi_twin(tmp_path, sources, jacobian) -> None:
    law = CController("pd", inputs={"q_ref": 2}, jacobian=jacobian)
    twin = mbs.export.fmu(arm(), tmp_path / "twin.fmu", controller=pd_function())
    path = mbs.export.fmu(
        arm(), tmp_path / "c.fmu", fmi="3.0", controller=law, sources=sources, solver="rodas"
    )
    wanted = {"q_ref[1]": 0.7, "q_ref[2]": -0.4}
    one, other = run(path, **wanted), run(twin, **wanted)
    for name in ("j1.q", "j2.q", "j1.v", "j2.tau"):
        assert np.abs(one[name] - other[name]).max() < 1e-7, name
    assert fmpy.validation.validate_fmu(str(path)) == []


@pytest.mark.parametrize(("jacobian", "tolerance"), [(None, 1e-8), ("pd_slopes", 1e-13)])
def test_derivatives_go_through_a_law_in_c(sources, jacobian, tolerance) -> None:
    law = CController("pd", inputs={"q_ref": 2}, jacobian=jacobian)
    in_c = fmu_model(arm(), FmuOptions(controller=law, sources=sources)).rhs
    twin = fmu_model(arm(), FmuOptions(controller=pd_function())).rhs
    point = 0.3, [0.2, 0.5, 1.0, -2.0], [], [0.7, -0.4], []
    assert np.abs(np.array(in_c(*point)[0] - twin(*point)[0])).max() < 1e-13
    slopes = [[np.array(J) for J in f.jacobian()(*point, *f(*point))] for f in (in_c, twin)]
    for one, other in zip(*slopes, strict=True):
        assert np.abs(one - other).max(initial=0) <= tolerance * (1 + np.abs(other).max(initial=0))
    seeds = np.array([1.0, -2.0, 0.5, 3.0]), np.zeros(in_c.numel_out(1))
    back = [f.reverse(1)(*point, *f(*point), *seeds) for f in (in_c, twin)]
    for one, other in zip(*back, strict=True):
        assert np.abs(np.array(one) - np.array(other)).max(initial=0) < tolerance * 1e3


def test_what_calls_a_law_in_c_is_integrated_by_the_interpreter(sources) -> None:
    law = CController("pd", inputs={"q_ref": 2}, jacobian="pd_slopes")
    x = ca.MX.sym("x", 4)
    runs = []
    for controller in (law, pd_function()):
        model = fmu_model(arm(), FmuOptions(controller=controller, sources=sources))
        call = mbs.native.compiled(model.rhs)
        rhs = ca.Function("f", [ca.MX.sym("t"), x], [call(0.0, x, [], [0.7, -0.4], [])[0]])
        runs.append(integrate(rhs, [0.2, 0.5, 1.0, -2.0], [0.0, 0.05], rtol=1e-9))
    assert np.abs(runs[0] - runs[1]).max() < 1e-12
    assert np.abs(runs[0][1] - runs[0][0]).max() > 0.01


def test_an_fmu_gives_the_derivatives_of_its_law(tmp_path, sources) -> None:
    law = CController("pd", inputs={"q_ref": 2}, jacobian="pd_slopes")
    path = mbs.export.fmu(arm(), tmp_path / "c.fmu", controller=law, sources=sources)
    fmpy.extract(str(path), str(tmp_path / "unzipped"))
    importer = ca.DaeBuilder("m", str(tmp_path / "unzipped"))
    f = importer.create("f", ["x", "u"], ["ode"])
    J = f.jacobian()([0.2, 0.5, 1.0, -2.0], [0.7, -0.4], [0, 0, 0, 0])
    twin = fmu_model(arm(), FmuOptions(controller=pd_function())).rhs
    point = 0.0, [0.2, 0.5, 1.0, -2.0], [], [0.7, -0.4], []
    exact = twin.jacobian()(*point, *twin(*point))
    for one, other in zip(J, (exact[1], exact[3]), strict=True):
        assert np.abs(np.array(one) - np.array(other)).max() < 1e-9


def test_inputs_of_a_function_are_named_and_keep_their_defaults() -> None:
    t, q, v, r, gain = (
        ca.SX.sym(n, k) for n, k in (("t", 1), ("q", 2), ("v", 2), ("r", 2), ("gain", 1))
    )
    names = ["t", "q", "v", "r", "gain"]
    options = {"default_in": [0, 0, 0, 0, 5.0]}
    law = ca.Function("p", [t, q, v, r, gain], [gain * (r - q)], names, ["tau"], options)
    model = fmu_model(arm(), FmuOptions(controller=law))
    assert [(u.name, u.start) for u in model.inputs] == [("r[1]", 0), ("r[2]", 0), ("gain", 5)]
    assert "j1.tau" in [y.name for y in model.outputs]


def _law(sizes, outputs, names=None, inputs=None):
    symbols = [ca.SX.sym(f"i{k}", *size) for k, size in enumerate(sizes)]
    values = [ca.SX.zeros(n) for n in outputs]
    return ca.Function(
        "law",
        symbols,
        values,
        inputs or [f"i{k}" for k in range(len(sizes))],
        names or [f"o{k}" for k in range(len(outputs))],
    )


@pytest.mark.parametrize(
    ("controller", "message"),
    [
        (
            _law([(1,), (2,), (2,)], [2], inputs=["t", "v", "q"]),
            r"has inputs t, v, q; give t, q and v first",
        ),
        (_law([(1,), (3,), (2,)], [2]), r"starts with inputs of sizes \[1, 3, 2\]; give t, q"),
        (_law([(1,), (2,), (2,), (2, 2)], [2]), r"input i3 of the controller law has 2 columns"),
        (_law([(1,), (2,), (2,)], [3]), r"gives 3 values of tau, the system has 2"),
        (_law([(1,), (2,), (2,)], [2, 2], ["tau", "force"]), r"outputs tau, force; call them"),
        (_law([(1,), (2,), (2,)], [1], ["u"]), r"gives 1 values of u, the system has 0"),
        ("pd", r"controller pd is a C function without source"),
        (3, r"the controller is 3; give a function"),
    ],
)
def test_laws_that_do_not_fit_are_refused(controller, message) -> None:
    with pytest.raises(ExportError, match=rf"arm: .*{message}"):
        fmu_model(arm(), FmuOptions(controller=controller))


def test_a_python_law_that_gives_too_little_is_refused() -> None:
    with pytest.raises(ModelError, match="tau has 1 values, the system has 2"):
        fmu_model(arm(), FmuOptions(controller=lambda t, q, v: [t]))


def test_sources_that_are_none_are_refused(tmp_path, sources) -> None:
    for given, message in (
        ([tmp_path / "none.c"], "none.c cannot be read"),
        ([tmp_path / "law.py"], "law.py is no C file"),
        ([sources[0], sources[0]], "controller.c is given twice"),
        ([sources[1]], "C function without source"),
        (7, "sources: 7 is no list of paths"),
    ):
        with pytest.raises(ExportError, match=message):
            fmu_model(arm(), FmuOptions(controller="pd", sources=given))
    for name in ("closure.c", "mbs_law_pd.c"):
        (tmp_path / name).write_text(LAW)
        with pytest.raises(ExportError, match=rf"{name} .*rename"):
            fmu_model(arm(), FmuOptions(controller="pd", sources=[tmp_path / name, sources[1]]))
    law = CController("other", inputs={"q_ref": 2})
    with pytest.raises(CompilerError, match="other"):
        mbs.export.fmu(arm(), tmp_path / "x.fmu", controller=law, sources=sources)


@pytest.mark.parametrize("name", ["core_do_step", "stepper_table", "mbs_rhs", "fmi2DoStep"])
def test_a_function_that_is_called_as_one_of_the_fmu_is_refused(tmp_path, sources, name) -> None:
    path = tmp_path / "law.c"
    path.write_text(LAW.replace("void pd(", f"void {name}("))
    with pytest.raises(ExportError, match=rf"law\.c defines {name}, which is a function"):
        fmu_model(arm(), FmuOptions(controller=name, sources=[path, sources[1]]))
    path.write_text(
        LAW.replace("void pd(", f"static double {name}(void) {{ return 1; }}\nvoid pd(")
    )
    fmu_model(arm(), FmuOptions(sources=[path, sources[1]]))


@pytest.mark.parametrize("name", ["gather", "evaluate", "differentiate"])
def test_a_law_in_c_may_have_any_other_name(tmp_path, sources, name) -> None:
    path = tmp_path / "law_pd.c"
    path.write_text(LAW.replace("void pd(", f"void {name}("))
    law = CController(name, inputs={"q_ref": 2}, jacobian="pd_slopes")
    rhs = fmu_model(arm(), FmuOptions(controller=law, sources=[path, sources[1]])).rhs
    twin = fmu_model(arm(), FmuOptions(controller=pd_function())).rhs
    point = 0.3, [0.2, 0.5, 1.0, -2.0], [], [0.7, -0.4], []
    assert np.abs(np.array(rhs(*point)[0] - twin(*point)[0])).max() < 1e-13


def _values(model, function_output):
    return dict(
        zip([y.name for y in model.outputs], np.array(function_output).ravel(), strict=True)
    )


def test_a_law_drives_the_joints_whose_motion_is_no_input() -> None:
    model = fmu_model(arm(), FmuOptions(inputs=["j1.a"], controller=pd))
    assert [u.name for u in model.inputs] == ["j1.a"]
    q, v = np.array([0.1, 0.2]), np.array([0.3, 0.4])
    tau = 30 * (np.array([0.7, -0.4]) - q) - 4 * v * (1 + v**2) + [0.5, 0]
    xdot, y = model.rhs(0.5, [*q, *v], [], [1.5], [])
    a, drive = mbs.models.hybrid_dynamics(arm(), ["j1"])(q, v, tau, [1.5])
    assert np.abs(np.array(xdot).ravel() - [*v, *np.array(a).ravel()]).max() < 1e-11
    assert abs(_values(model, y)["j1.tau"] - tau[0] - float(drive)) < 1e-11
    assert abs(_values(model, y)["j2.tau"] - tau[1]) < 1e-12


def test_a_law_sees_the_whole_tree_of_a_closed_system() -> None:
    system = catalogue_system("four_bar")
    driven = [speed.name for speed in system.velocity_coordinates].index("j1")
    model = fmu_model(system, FmuOptions(controller=lambda t, q, v: [-3 * sum(q.nz) - v[0], 0, 0]))
    plain = fmu_model(system)
    q, v = np.array(system.configuration), 0.4
    z = [q[k] for k in range(3) if k != driven]
    x = [q[driven], v]
    speeds = _values(plain, plain.rhs(0, x, z, [0], [])[1])
    tau = -3 * q.sum() - (v if driven == 0 else speeds[f"{system.velocity_coordinates[0].name}.v"])
    one, other = model.rhs(0, x, z, [], []), plain.rhs(0, x, z, [tau], [])
    assert np.abs(np.array(one[0] - other[0])).max() < 1e-9
    assert abs(_values(model, one[1])["j1.tau"] - tau) < 1e-12


def test_a_law_gives_the_inputs_of_devices() -> None:
    m = mbs.Mechanism("driven", gravity=(0, -9.81, 0))
    rod = m.add(Body("rod", mass=1.0, com=(0.2, 0, 0), inertia=TENSOR))
    joint = Revolute("j1", axis="z")
    m.connect(m.world, joint, rod)
    motor = DCMotor("motor", resistance=1.5, inductance=0.02, constant=0.08, inertia=1e-4)
    m.connect(motor.flange, joint.flange)
    system = m.assemble()
    t, q, v, w = (ca.SX.sym(n) for n in ("t", "q", "v", "goal"))
    law = ca.Function("law", [t, q, v, w], [9 * (w - q) - v], ["t", "q", "v", "goal"], ["u"])
    model, plain = fmu_model(system, FmuOptions(controller=law)), fmu_model(system)
    assert [u.name for u in plain.inputs] == ["motor.voltage"]
    assert [u.name for u in model.inputs] == ["goal"]
    x = [0.2, 0.3, 0.1]
    one = model.rhs(0, x, [], [1.0], [])
    other = plain.rhs(0, x, [], [9 * (1.0 - 0.2) - 0.3], [])
    assert np.abs(np.array(one[0] - other[0])).max() < 1e-12
