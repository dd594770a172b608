"""Both tables of docs/validity.md about the content of users: each cell is tried."""

import pickle
from functools import cache
from pathlib import Path

import casadi
import numpy as np
import pytest
from support.bare_library import called, loaded

import mbs
from mbs import MbsError
from mbs.app.tasks.simulation import SimulationSettings, simulate
from mbs.components import Box, Custom, Revolute, custom
from mbs.options import option_fields
from mbs.simulate.options import MotionOptions

PAGE = Path(__file__).parents[1] / "docs" / "validity.md"
DURATION = 0.2
CLOSE = 1e-6
"""Difference of motions that start alike [rad]: both integrate with a tolerance of 1e-8."""
SAME = 1e-6
"""The same on other paths: fixed steps of 2 ms err by 1e-8, importers by their tolerance."""


def rows_of(heading):
    """The head and the rows of the first table of a section."""
    section = PAGE.read_text().split(f"## {heading}\n")[1].split("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    cells = [[x.strip() for x in line.strip("|").split("|")] for line in lines]
    return cells[0], cells[2:]


# One mechanism with all that a user may give: a loop with a parameter, and a component with states
# and an input.


class Brake(Custom):
    """A torque on a shaft that follows its input late."""

    shaft = custom.coordinate()
    u = custom.input("N.m")
    x = custom.state("N.m")

    def rates(self, at):
        return {"x": 5.0 * (at.u - at.x)}

    def loads(self, at):
        return {"shaft": at.x}


def mechanism(**options):
    m = mbs.Mechanism("loop", gravity=(0, -9.81, 0), **options)
    lengths = {"a": mbs.Parameter("A", 0.4), "b": 1.0, "c": 0.9}
    a, b, c = (m.add(Box(n, length=x, width=0.05, density=2700)) for n, x in lengths.items())
    m.connect(m.world, Revolute("j1", actuated=True), a.left)
    m.connect(a.right, Revolute("j2"), b.left)
    m.connect(b.right, Revolute("j3"), c.right)
    m.connect(m.world.at(0.8), Revolute("j4"), c.left)
    m.add(Brake("brake", "j1"))
    return m


@cache
def loop():
    return mechanism(guess={"j2": 1.0}).assemble()


@cache
def motion():
    """A motion from rest under gravity and the brake."""
    return mbs.simulate.run(loop(), 0.3, step=0.1, u=[0.5], quiet=True)


def end(**options):
    """Positions at the end of a motion of `run`."""
    result = mbs.simulate.run(loop(), DURATION, step=DURATION, quiet=True, **options)
    return [result[f"{c.name}.q"][-1] for c in loop().coordinates]


def linear(**at):
    return mbs.models.linearise(loop()).at(**at).A


def fmu_end(tmp_path, **options):
    path = mbs.export.fmu(loop(), tmp_path / "loop.fmu")
    result = mbs.simulate.fmu(path, DURATION, step=DURATION, quiet=True, **options)
    return [result[f"{name}.q"][-1] for name in ("j1", "j2", "j4")]


def gravity_of(mechanism):
    return [float(value.value) for value in mechanism.world.gravity]


TURNED = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]
MOUNTS = {"list": TURNED, "array": np.array(TURNED), "dict": {"rotation": TURNED}}
"""A base upside down."""


# Forms of content. Each argument has values of the forms that fit it; forms that are left out have
# a value of this table.


FORMS = (
    *("number", "list", "array", "dict", "text", "DM", "SX", "function", "State", "Result", "None"),
    *("unknown name", "NaN"),
)


def general(form):
    values = {
        "number": 0.3,
        "list": [0.3],
        "array": np.array([0.3]),
        "dict": {"j1": 0.3},
        "text": "some text",
        "DM": casadi.DM(0.3),
        "SX": casadi.SX.sym("x"),
        "function": lambda *_: 0.3,
        "None": None,
        "unknown name": {"nothing": 0.3},
        "NaN": float("nan"),
    }
    if form == "State":
        return motion().state()
    return motion() if form == "Result" else values[form]


def positions(values, unknown="nothing"):
    """All forms of values by name."""
    every = list(values.values())
    return {
        "list": every,
        "array": np.array(every),
        "dict": values,
        "DM": casadi.DM(every),
        "SX": casadi.SX.sym("x", len(every)),
        "unknown name": {unknown: 0.3},
        "NaN": dict.fromkeys(values, float("nan")),
    }


def by_name(values):
    return {"dict": values, "unknown name": {"nothing": 0.3}, "NaN": dict.fromkeys(values, np.nan)}


def names(good, unknown="nothing"):
    return {"list": [good], "text": good, "dict": {good: 1.0}, "unknown name": [unknown]}


FRAME = {"antecedent": 0, "joint": "revolute", "d": "L"}
TABLE = {"name": "arm", "parameters": {"L": 0.2}, "frame": [FRAME]}


def law(t, q, v):
    return casadi.vertcat(0.3, 0, 0)


def dae_start(**start):
    found = mbs.models.dae(loop(), **start)
    return [*found.x0, *found.u0]


def count(n):
    return lambda made: [float(n(made))]


# argument -> a call with the content that returns numbers, and the content in the forms that fit.
# All forms that are accepted have the same effect, except None, which is the default.


def arguments(tmp_path):
    run = mbs.simulate.run
    Q, V, Z = (dict(getattr(motion().state(), kind)) for kind in "qvz")
    quiet = {"quiet": True, "step": DURATION}

    def rows(**options):
        options = {"duration": DURATION, "step": 0.05, "quiet": True, **options}
        result = run(loop(), **options)
        return [len(result), result["j1.q"][-1]]

    def simulated(names, **options):
        result = mbs.simulate.Simulator(loop(), names)(DURATION, step=DURATION, **options)
        return [result["j1.q"][-1]]

    def swept(grid, **options):
        study = mbs.simulate.sweep(loop(), grid, DURATION, folder=None, **quiet, **options)
        if study.failures:
            raise MbsError(study.failures[0])
        return [study[k]["j1.q"][-1] for k in range(len(study.cases))]

    def exported(**options):
        path = mbs.export.fmu(loop(), tmp_path / "options.fmu", **options)
        return [len(path.name)]

    def of_fmu(**options):
        return fmu_end(tmp_path, **options)

    return {
        "`run(q0=)`": (lambda x: end(q0=x, v0={}, z0={"brake.x": 0}), positions(Q)),
        "`run(v0=)`": (lambda x: end(q0=Q, v0=x), positions(V)),
        "`run(z0=)`": (lambda x: end(z0=x), positions(Z)),
        "`run(tau=)`": (
            lambda x: end(tau=x),
            {**positions({"j1": 0.3, "j2": 0, "j4": 0}), "dict": {"j1": 0.3}, "function": law},
        ),
        "`run(u=)`": (
            lambda x: end(u=x),
            {**positions({"brake.u": 0.3}), "function": lambda t, q, v: 0.3},
        ),
        "`run(motion=)`": (lambda x: end(motion=x), by_name({"j1.q": 0.1})),
        "`run(guess=)`": (lambda x: end(q0={"j1": Q["j1"]}, guess=x), by_name(Q)),
        "`run(parameters=)`": (lambda x: end(parameters=x), by_name({"A": 0.41})),
        "`run(duration=)`": (lambda x: rows(duration=x), {"number": DURATION}),
        "`run(step=)`": (lambda x: rows(step=x), {"number": 0.1}),
        "`run(tolerance=)`": (
            lambda x: rows(tolerance=x),
            {"number": 1e-6, "dict": {"others": 1e-6}, "NaN": {"rad": float("nan")}},
        ),
        "`run(max_step=)`": (lambda x: rows(max_step=x), {"number": 0.01}),
        "`run(method=)`": (lambda x: rows(method=x), {"text": "rodas", "unknown name": "euler"}),
        "`Simulator(inputs=)`": (lambda x: simulated(x), names("brake.u")),
        "`Simulator(outputs=)`": (
            lambda x: [len(mbs.simulate.Simulator(loop(), (), x)(0.1, step=0.1).names)],
            names("j1.q"),
        ),
        "`simulator(inputs=)`": (
            lambda x: simulated(["brake.u"], inputs=x),
            by_name({"brake.u": 0.3}),
        ),
        "`sweep(grid)`": (
            swept,
            {
                "dict": {"j1.v": [0.1]},
                "list": [{"j1.v": 0.1}],
                "unknown name": {"nothing": [0.1]},
                "NaN": {"j1.v": [float("nan")]},
            },
        ),
        "`sweep(q0=)`": (lambda x: swept({"j1.tau": [0.1]}, q0=x, v0={}, z0={}), positions(Q)),
        "`assemble(guess=)`": (lambda x: mechanism().assemble(guess=x).configuration, by_name(Q)),
        "`assemble(active=)`": (
            lambda x: mechanism(guess={"j2": 1.0}).assemble(active=x).chosen_coordinates,
            names("j2"),
        ),
        "`loops.solve(q_active)`": (lambda x: mbs.loops.solve(loop(), x), positions(Q)),
        "`loops.solve(guess=)`": (
            lambda x: mbs.loops.solve(loop(), {"j1": Q["j1"]}, guess=x),
            by_name(Q),
        ),
        "`loops.solve(branch=)`": (
            lambda x: mbs.loops.solve(loop(), {"j1": 0.3}, branch=x),
            names("j3:-"),
        ),
        "`linearise(outputs=)`": (
            lambda x: [len(mbs.models.linearise(loop(), x).y)],
            names("j1.q"),
        ),
        "`linearise(mode=)`": (
            lambda x: [len(mbs.models.linearise(loop(), mode=x).y)],
            {"dict": {}, "unknown name": {"nothing": 0}, "NaN": {"nothing": float("nan")}},
        ),
        "`linearise(..).at(q0=)`": (lambda x: linear(q0=x, v0={}, states={}), positions(Q)),
        "`linearise(..).at(v0=)`": (lambda x: linear(q0=Q, v0=x), positions(V)),
        "`linearise(..).at(states=)`": (lambda x: linear(states=x), by_name(Z)),
        "`dae(q0=)`": (lambda x: dae_start(q0=x, v0={}, states={}), positions(Q)),
        "`dae(v0=)`": (lambda x: dae_start(q0=Q, v0=x), positions(V)),
        "`dae(tau0=)`": (lambda x: dae_start(tau0=x), positions({"j1": 0.3, "j2": 0, "j4": 0})),
        "`Mechanism(gravity=)`": (
            lambda x: gravity_of(mbs.Mechanism("m", gravity=x)),
            {"list": [0, 0, -1], "array": np.array([0, 0, -1.0])},
        ),
        "`Mechanism(mount=)`": (lambda x: gravity_of(mbs.Mechanism("m", mount=x)), MOUNTS),
        "`load(gravity=)`": (
            lambda x: gravity_of(mbs.load(TABLE, gravity=x)),
            {"list": [0, 0, -1], "array": np.array([0, 0, -1.0])},
        ),
        "`load(mount=)`": (lambda x: gravity_of(mbs.load(TABLE, mount=x)), MOUNTS),
        "`Mechanism(name)`": (lambda x: [len(mbs.Mechanism(x).name)], {"text": "name"}),
        "`load(source)`": (
            lambda x: [isinstance(mbs.load(x), mbs.Mechanism)],
            {"text": "scara", "unknown name": "scaraa", "dict": TABLE},
        ),
        "`load(parameters=)`": (
            lambda x: [mbs.load(TABLE, x).values["L"].default],
            by_name({"L": 0.3}),
        ),
        "joint `limits=`": (
            lambda x: np.ravel([pair for _, pair in Revolute("j", limits=x).limits]),
            {"list": [-1, 1], "array": np.array([-1.0, 1.0]), "NaN": [float("nan"), 1.0]},
        ),
        "`export.fmu(inputs=)`": (lambda x: exported(inputs=x), names("j1.a")),
        "`export.fmu(outputs=)`": (lambda x: exported(outputs=x), names("energy")),
        "`export.fmu(parameters=)`": (lambda x: exported(parameters=x), names("masses")),
        "`export.fmu(path)`": (
            lambda x: [len(mbs.export.fmu(loop(), x).suffix)],
            {"text": str(tmp_path / "path.fmu")},
        ),
        "`simulate.fmu(start=)`": (
            lambda x: of_fmu(start=x),
            by_name({"j1.q": Q["j1"], "j1.v": V["j1"], **Z}),
        ),
        "`simulate.fmu(inputs=)`": (lambda x: of_fmu(inputs=x), by_name({"brake.u": 0.5})),
        "`simulate.fmu(parameters=)`": (lambda x: of_fmu(parameters=x), by_name({"A": 0.41})),
        "`result[name]`": (lambda x: motion()[x], {"text": "j1.q", "unknown name": "nothing"}),
        "`result.state(t)`": (
            lambda x: list(motion().state(x).q.values()),
            {"number": motion().time[1]},
        ),
    }


HEAD, ROWS = rows_of("Arguments")


def test_the_table_of_arguments_is_whole(tmp_path):
    assert ["argument", *FORMS] == HEAD
    assert [row[0] for row in ROWS] == list(arguments(tmp_path))


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0].strip("`"))
def test_each_form_of_an_argument_works_or_raises_one_error(row, tmp_path, monkeypatch):
    """Forms that work have the same effect; None is the default."""
    monkeypatch.chdir(tmp_path)
    call, forms = arguments(tmp_path)[row[0]]
    effects = []
    for form, cell in zip(FORMS, row[1:], strict=True):
        content = forms.get(form, general(form))
        if cell == "error":
            with pytest.raises(MbsError) as error:
                call(content)
            assert "\n" not in str(error.value)
            continue
        assert cell == "works"
        effect = np.array(call(content), dtype=float).ravel()
        if form != "None":
            effects.append(effect)
    for effect in effects[1:]:
        np.testing.assert_allclose(effect, effects[0], rtol=0, atol=CLOSE)


# Paths: the same content gives the same motion on every path.


def jumping(t, q, v):
    return casadi.vertcat(casadi.if_else(t < DURATION / 2, 0.3, -0.4), 0, 0)


def content_of(name):
    """Content as the arguments of `run`."""
    return {
        "positions at the start": {"q0": {"j1": 0.2}},
        "velocities at the start": {"v0": {"j1": 0.5}},
        "states of components": {"z0": {"brake.x": 0.4}},
        "a `State`": {"q0": motion().state(motion().time[1])},
        "a guess of the branch": {"q0": {"j1": 0.2}, "guess": {"j2": -1.2, "j4": -1.0}},
        "constant efforts": {"tau": {"j1": 0.3}},
        "efforts that jump": {"tau": jumping},
        "constant inputs of components": {"u": {"brake.u": 0.6}},
        "a prescribed motion": {"motion": {"j1.a": lambda t: 0.5}},
        "parameters": {"parameters": {"A": 0.41}},
        "the longest step": {"max_step": 0.01},
        "a tolerance": {"tolerance": 1e-9},
    }[name]


def by_run(name, content, tmp_path):
    return mbs.simulate.run(loop(), DURATION, step=DURATION, quiet=True, **content)["j1.q"][-1]


def by_simulator(name, content, tmp_path):
    """Laws are given once; numbers at each call."""
    laws = {key: content[key] for key in ("tau", "motion") if key in content}
    given = {key: value for key, value in content.items() if key not in (*laws, "u")}
    inputs = dict(content.get("u", {}))
    if isinstance(laws.get("tau"), dict):
        inputs |= {f"{joint}.tau": value for joint, value in laws.pop("tau").items()}
    simulator = pickle.loads(pickle.dumps(mbs.simulate.Simulator(loop(), list(inputs), **laws)))
    return simulator(DURATION, step=DURATION, inputs=inputs, **given)["j1.q"][-1]


def by_sweep(name, content, tmp_path):
    """Numbers by name are in the grid, the others are options."""
    grid, options = {}, dict(content)
    for key, end in {
        "q0": ".q",
        "v0": ".v",
        "z0": "",
        "tau": ".tau",
        "u": "",
        "parameters": "",
    }.items():
        if type(options.get(key)) is dict:
            grid |= {f"{one}{end}": [value] for one, value in options.pop(key).items()}
    grid = grid or {"A": [0.4]}
    study = mbs.simulate.sweep(loop(), grid, DURATION, step=DURATION, quiet=True, **options)
    assert not study.failures
    return study[0]["j1.q"][-1]


def by_fmu(fmi, kind):
    def simulated(name, content, tmp_path):
        exported, start, inputs = {}, {}, {}
        for key in ("max_step", "tolerance"):
            if key in content:
                exported[key] = content[key]
        if "motion" in content:
            exported["inputs"], inputs["j1.a"] = ["j1.a"], 0.5
        if content.get("tau") is jumping:
            half = DURATION / 2  # twice: a jump
            inputs["j1.tau"] = [0.0, half, half, DURATION], [0.3, 0.3, -0.4, -0.4]
        elif "tau" in content:
            inputs |= {f"{joint}.tau": value for joint, value in content["tau"].items()}
        inputs |= content.get("u", {})
        if type(content.get("q0")) is mbs.State:
            start = content["q0"]
        else:
            for key, end in {"q0": ".q", "guess": ".solved", "v0": ".v", "z0": ""}.items():
                start |= {f"{one}{end}": value for one, value in content.get(key, {}).items()}
        path = mbs.export.fmu(loop(), tmp_path / "loop.fmu", fmi=fmi, **exported)
        result = mbs.simulate.fmu(
            path,
            DURATION,
            step=DURATION / 10,
            start=start,
            inputs=inputs,
            parameters=content.get("parameters", {}),
            kind=kind,
            quiet=True,
            **({"tolerance": content["tolerance"]} if "tolerance" in content else {}),
        )
        return result["j1.q"][-1]

    return simulated


def stepped(content, advance):
    """The motion by fixed steps with the effort and the input at each."""
    keys = {"q0", "v0", "guess", "parameters"}
    start = {key: content[key] for key in keys if key in content}
    dae = mbs.models.dae(loop(), states=content.get("z0"), **start)
    step, x = mbs.bridges.step(dae), dae.x0
    run, size = advance(step), DURATION / 100
    for k in range(100):
        tau = content.get("tau", {"j1": 0})
        tau = float(jumping((k + 0.5) * size, 0, 0)[0]) if tau is jumping else tau["j1"]
        x = run(x, [tau, content.get("u", {"brake.u": 0})["brake.u"]], dae.p0, size)
    return x[0]


def by_bridge(name, content, tmp_path):
    return stepped(content, lambda step: lambda *at: step(*at).full().ravel())


def by_c_library(name, content, tmp_path):
    def advance(step):
        folder = mbs.export.c_library([step], tmp_path / "c")
        library = loaded(folder)

        def run(*at):
            status, (x,) = called(folder, library, step, at)
            assert status == 0
            return x

        return run

    return stepped(content, advance)


def by_page(name, content, tmp_path):
    """The settings of the page and of the command line."""
    names = {"u": "inputs"}
    given = {names.get(key, key): value for key, value in content.items()}
    if "motion" in given:
        given["motion"] = {"j1.a": "0.5"}
    options = {name: given.pop(name) for name in option_fields(MotionOptions) if name in given}
    settings = SimulationSettings(duration=DURATION, options={"step": DURATION, **options}, **given)
    return simulate(loop(), settings, quiet=True)["j1.q"][-1]


PATHS = {
    "`run`": by_run,
    "`Simulator`": by_simulator,
    "`sweep`": by_sweep,
    "FMU 2.0, CS": by_fmu("2.0", "CoSimulation"),
    "FMU 2.0, ME": by_fmu("2.0", "ModelExchange"),
    "FMU 3.0, CS": by_fmu("3.0", "CoSimulation"),
    "FMU 3.0, ME": by_fmu("3.0", "ModelExchange"),
    "C library": by_c_library,
    "`bridges.step`": by_bridge,
    "page, command line": by_page,
}
PATH_HEAD, PATH_ROWS = rows_of("Paths")


def test_the_table_of_paths_is_whole():
    assert ["content", *PATHS] == PATH_HEAD
    for row in PATH_ROWS:
        assert content_of(row[0])


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("row", PATH_ROWS, ids=lambda row: row[0])
def test_content_has_the_same_effect_on_every_path(row, path, tmp_path, monkeypatch):
    if row[1 + list(PATHS).index(path)] == "-":
        return
    monkeypatch.chdir(tmp_path)
    content = content_of(row[0])
    expected = by_run(row[0], content, tmp_path)
    assert PATHS[path](row[0], content, tmp_path) == pytest.approx(expected, abs=SAME)
