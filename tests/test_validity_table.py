"""The table of docs/validity.md is true: every bad input is given to every way to call a model."""

import pickle
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import casadi
import fmpy
import numpy as np
import pytest
from support.bare_library import called, loaded

import mbs
from mbs import MbsError
from mbs.bridges import step
from mbs.components import Body, Box, Cylinder, Fixed, Revolute, Spherical, Spring

PAGE = Path(__file__).parents[1] / "docs" / "validity.md"
STATUSES = (
    "MBS_OK",
    "MBS_NOT_FINITE",
    "MBS_QUATERNION",
    "MBS_PARAMETER",
    "MBS_OPEN",
    "MBS_UNDETERMINED",
    "MBS_NO_RESULT",
)
STEP = 0.01
"""Of steps in a batch [s], short enough for these mechanisms."""


# the mechanisms: a tree with a quaternion and bounded parameters, and a loop


def arm():
    m = mbs.Mechanism("arm", gravity=(0, 0, -9.81))
    box = m.add(Box("box", length=mbs.Parameter("L", 0.5), width=0.1, mass=3.0))
    mass = mbs.Parameter("M1", 2.0) - mbs.Parameter("M2", 0.5)
    com = (mbs.Parameter("B", 0.3, min=0.1, max=0.9), 0, 0)
    link = m.add(Body("link", mass=mass, com=com, inertia=(0.1, 0.1, 0.1)))
    radii = {"radius": mbs.Parameter("R", 0.05), "inner_radius": mbs.Parameter("r", 0.04)}
    tube = m.add(Cylinder("tube", length=0.4, density=2700, **radii))
    mass = mbs.Parameter("M", 2.0)
    ball = m.add(Body("ball", mass=mass, com=(0.1, 0.2, 0.3), inertia=(1, 2, 3)))
    m.connect(m.world, Revolute("yaw", axis="z", actuated=True), box.left)
    m.connect(box.right, Revolute("bend", axis="y", actuated=True), link)
    m.connect(box.right, Fixed("weld"), tube.left)
    m.connect(m.world.at(0, 1, 0), Spherical("s"), ball)
    k = mbs.Parameter("K", 4.0)
    m.add(Spring("spring", m.world.at(0, 0, 1), link.at(0.5), stiffness=k, length=0.1))
    return m.assemble()


def four_bar():
    """Its rocker is the independent joint; crank and coupler align where it turns back."""
    m = mbs.Mechanism("loop", gravity=(0, -9.81, 0), guess={"j2": 1.0})
    lengths = {"a": mbs.Parameter("A", 0.4), "b": 1.0, "c": 0.9}
    a, b, c = (m.add(Box(n, length=x, width=0.05, density=2700)) for n, x in lengths.items())
    m.connect(m.world, Revolute("j1"), a.left)
    m.connect(a.right, Revolute("j2"), b.left)
    m.connect(b.right, Revolute("j3"), c.right)
    m.connect(m.world.at(0.8), Revolute("j4", actuated=True), c.left)
    return m.assemble()


@dataclass(frozen=True)
class Subject:
    """A system and, made once, everything that it can be called through."""

    system: Any
    model: Any
    good: dict[str, np.ndarray]
    folder: Path
    made: dict[str, Any] = field(default_factory=dict)

    def once(self, key: str, make: Callable[[], Any]) -> Any:
        if key not in self.made:
            self.made[key] = make()
        return self.made[key]

    def inputs(self, values: dict[str, float]) -> dict[str, np.ndarray]:
        """Inputs of the model, some elements changed, such as `s.qw.q`, `yaw.tau` or `M`."""
        changed, left = {name: x.copy() for name, x in self.good.items()}, dict(values)
        for name, x in changed.items():
            ending = "" if name == "p" else "." + name.removesuffix("_a").removesuffix("_m")
            for k, (element, _) in enumerate(self.model.elements(name)):
                if f"{element}{ending}" in left:
                    x[k] = left.pop(f"{element}{ending}")
        assert not left
        return changed


@pytest.fixture(scope="module")
def subjects(tmp_path_factory):
    made = {}
    for make in (arm, four_bar):
        system = make()
        model = mbs.models.direct_dynamics(system)
        sizes = {name: model.size1_in(name) for name in model.name_in()}
        good = {name: np.full(n, 0.2) for name, n in sizes.items()}
        good["q"] = np.array(system.configuration)
        if not system.is_closed:
            good["q"][:2] = 0.3, 0.4
        good["p"] = np.array(system.p_default)
        folder = tmp_path_factory.mktemp(system.name)
        made[system.name] = Subject(system, model, good, folder)
    return made


# the bad inputs


@dataclass(frozen=True)
class Bad:
    """A row of the table.

    Attributes:
        of: name of the system.
        values: elements by name and what they are, as FMUs and sweeps know them.
        shaped: makes an input of a good one, for what elements cannot say: (name, changed).
        call: how a model or a batch is called wrongly with good inputs.
        dt: of a step [s].
    """

    of: str = "arm"
    values: dict[str, Any] = field(default_factory=dict)
    shaped: tuple[str, Callable[[np.ndarray], Any]] | None = None
    call: Callable[[Any, dict[str, Any]], Any] | None = None
    dt: float = STEP


def twice(f: Any, x: dict[str, Any]) -> Any:
    return f(*x.values(), q=x["q"])


def missing(f: Any, x: dict[str, Any]) -> Any:
    return f(*list(x.values())[:2])


def unknown(f: Any, x: dict[str, Any]) -> Any:
    return f(**x, torque=x["q"])


def words(x: np.ndarray) -> list[Any]:
    return [*x[:-1], "one"]


def masked(x: np.ndarray) -> Any:
    return np.ma.masked_array(x, mask=np.arange(len(x)) == 0)


DEAD = {"j1.q": 0.0, "j2.q": 0.0, "j4.q": 0.0}  # told from the system by `moved`
ROWS = {
    "NaN in an input": Bad(values={"bend.tau": np.nan}),
    "NaN in a position without effect": Bad(values={"yaw.q": np.nan}),
    "infinity": Bad(values={"bend.v": np.inf}),
    "NaN in a parameter": Bad(values={"M1": np.nan}),
    "quaternion of length 2": Bad(values={"s.qw.q": 2.0}),
    "quaternion of length 0": Bad(values={"s.qw.q": 0.0}),
    "quaternion of length 1.001": Bad(values={"s.qw.q": 1.001}),
    "mass below zero": Bad(values={"M": -2.0}),
    "mass `M1 - M2` below zero": Bad(values={"M2": 3.0}),
    "length of zero": Bad(values={"L": 0.0}),
    "stiffness below zero": Bad(values={"K": -4.0}),
    "tube whose bore is wider than it": Bad(values={"r": 0.06}),
    "below the parameter's own `min`": Bad(values={"B": 0.05}),
    "above its `max`": Bad(values={"B": 1.0}),
    "loops open by 0.1 rad": Bad("loop", {"j1.q": 0.1}),
    "loops open by 1e-4 of the size": Bad("loop", {"j1.q": 1e-4}),
    "parameters that cannot close the loops": Bad("loop", {"A": 3.0}),
    "independent joints that determine nothing": Bad("loop", DEAD),
    "positions out of reach": Bad("loop", {"j4.q": 3.5}),
    "too few values": Bad(shaped=("q", lambda x: x[:-1])),
    "too many values": Bad(shaped=("q", lambda x: np.append(x, 0.0))),
    "square numpy array": Bad(shaped=("q", lambda x: np.tile(x, (len(x), 1)))),
    "array with a mask": Bad(shaped=("q", masked)),
    "complex numbers": Bad(shaped=("q", lambda x: x + 0j)),
    "text": Bad(shaped=("q", words)),
    "an input twice": Bad(call=twice),
    "an input left out": Bad(call=missing),
    "an unknown name": Bad(call=unknown),
    "a step that leaves the loops": Bad("loop", {"j4.v": 40.0}, dt=0.2),
}


def given(bad: Bad, subject: Subject) -> tuple[dict[str, Any], dict[str, Any]]:
    """Good inputs of the model and bad ones."""
    if bad.shaped:
        name, change = bad.shaped
        return subject.good, {**subject.good, name: change(subject.good[name])}
    return subject.good, subject.inputs(moved(bad, subject))


def moved(bad: Bad, subject: Subject) -> dict[str, Any]:
    """Values of a row; those of loops are told from the assembled configuration."""
    if bad.of != "loop" or bad.dt != STEP:
        return bad.values
    names = [c.name for c in subject.system.coordinates]
    configuration = dict(zip(names, subject.system.configuration, strict=True))
    if bad.values is DEAD:
        guess = {"j1": 0.5, "j4": configuration["j4"]}
        dead = subject.once(
            "dead", lambda: mbs.loops.solve(subject.system, {"j2": 0.0}, guess=guess)
        )
        return {f"{name}.q": float(x) for name, x in zip(names, dead, strict=True)}
    if "j1.q" in bad.values:
        return {"j1.q": configuration["j1"] + bad.values["j1.q"]}
    return bad.values


# the ways to call a model: each says with what word it answers, and that the good input passes


def require_sentence(text: str) -> None:
    """One, which says what to do."""
    assert text, "an error without a sentence"
    assert "\n" not in text, text
    assert not re.search(r"[a-z]\. [A-Z]|\.$", text), text
    assert re.search("; |, it needs|, the system has", text), text


def refusal(call: Callable[[], Any]) -> str:
    """`error` where an MbsError of one sentence is raised; else `number`."""
    try:
        call()
    except MbsError as error:
        require_sentence(str(error))
        return "error"
    return "number"


def by_place(f: Any, x: dict[str, Any]) -> Any:
    return f(*x.values())


def by_name(f: Any, x: dict[str, Any]) -> Any:
    return next(iter(f(**x).values()))


def in_columns(f: Any, x: dict[str, Any]) -> Any:
    return f(*(columns(value) for value in x.values()))


def columns(value: Any) -> Any:
    """Two states of one; what is no vector stays as it is."""
    if isinstance(value, np.ma.MaskedArray):
        return np.ma.column_stack((value, value))
    array = np.asarray(value)
    return array if array.ndim > 1 else np.column_stack((array, array))


CALLS = {
    "call": (lambda f: f, by_place),
    "by name": (lambda f: f, by_name),
    "expand": (lambda f: f.expand(), by_place),
    "map": (lambda f: f.map(2), in_columns),
    "compiled": (lambda f: mbs.native.compiled(f, derivatives=0), by_place),
    "fast": (lambda f: mbs.native.compiled(f, derivatives=0, fast=True), by_place),
    "pickled": (lambda f: pickle.loads(pickle.dumps(f)), by_place),
    "pickled, compiled": (
        lambda f: pickle.loads(pickle.dumps(mbs.native.compiled(f, derivatives=0))),
        by_place,
    ),
}


def model_path(path: str) -> Callable[[Bad, Subject], str]:
    make, call = CALLS[path]

    def answer(bad: Bad, subject: Subject) -> str:
        if bad.dt != STEP:
            return "-"
        f = subject.once(path, lambda: make(subject.model))
        good, wrong = given(bad, subject)
        wanted = np.array(unchecked(subject, good)).ravel()
        found = np.array(call(f, good)).reshape(len(wanted), -1)
        np.testing.assert_allclose(found[:, 0], wanted, rtol=1e-9, atol=1e-12)
        return refusal(lambda: (bad.call or call)(f, wrong))

    return answer


def unchecked(subject: Subject, good: dict[str, Any]) -> Any:
    """The model without its checks."""
    return casadi.Function(subject.model)(*good.values())


def rows_of_batch(bad: Bad, subject: Subject) -> str:
    if bad.dt != STEP:
        return "-"
    f = subject.once("batch", lambda: mbs.native.batch(subject.model))
    good, wrong = given(bad, subject)
    wanted = np.array(unchecked(subject, good)).ravel()
    np.testing.assert_allclose(by_place(f, good), wanted, rtol=1e-9)
    if bad.call:
        return refusal(lambda: bad.call(f, good))
    if not bad.shaped:
        return word_of_rows(f(*in_rows(good, wrong)), wanted)
    try:
        found = by_place(f, wrong)
    except MbsError:
        return refusal(lambda: by_place(f, wrong))
    np.testing.assert_allclose(found, np.tile(wanted, (len(found), 1)), rtol=1e-9)
    return "rows"


def in_rows(good: dict[str, np.ndarray], wrong: dict[str, np.ndarray]) -> list[np.ndarray]:
    """A bad row between good ones."""
    return [np.array([a, b, a]) for a, b in zip(good.values(), wrong.values(), strict=True)]


def word_of_rows(found: np.ndarray, wanted: np.ndarray) -> str:
    """`NaN` where the whole middle row is, its neighbours being right."""
    np.testing.assert_allclose(found[[0, 2]], [wanted, wanted], rtol=1e-9)
    if np.isnan(found[1]).all():
        return "NaN"
    return "number"


def rows_of_step(bad: Bad, subject: Subject) -> str:
    if bad.call or bad.shaped:
        return "-"
    dae = subject.once("dae", lambda: mbs.models.dae(subject.system))
    f = subject.once("step", lambda: mbs.native.batch(step(dae)))
    values, good = moved(bad, subject), {}
    for name in ("x", "u", "p"):
        good[name] = np.array(getattr(dae, f"{name}0"))
    wrong = {name: x.copy() for name, x in good.items()}
    known = 0
    for name, x in wrong.items():
        for k, (element, _) in enumerate(dae.elements[name]):
            if element in values:
                x[k], known = values[element], known + 1
    if not known:
        return "-"
    wanted = f(*good.values(), np.array([STEP]))
    assert np.isfinite(wanted).all()
    found = f(*in_rows(good, wrong), np.array([[STEP], [bad.dt], [STEP]]))
    word = word_of_rows(found, wanted)
    if word == "NaN" or not dae.invariants.numel():
        return word
    invariants = casadi.Function("invariants", [dae.x, dae.p], [dae.invariants])
    assert np.abs(invariants(found[1], wrong["p"]).full()).max() < 1e-12
    return "projects"


def c_library(bad: Bad, subject: Subject) -> str:
    if bad.call or bad.shaped or bad.dt != STEP:
        return "-"
    folder = subject.folder / "lib"
    library = subject.once(
        "c",
        lambda: loaded(mbs.export.c_library(subject.model, folder), ("-O0", "-fPIC", "-shared")),
    )
    good, wrong = given(bad, subject)
    status, outputs = called(folder, library, subject.model, good.values())
    assert status == 0
    np.testing.assert_allclose(outputs[0], np.array(unchecked(subject, good)).ravel(), rtol=1e-9)
    status, outputs = called(folder, library, subject.model, wrong.values())
    if status == 0:
        return "number"
    assert all(np.isnan(output).all() for output in outputs)
    return STATUSES[status]


def fmu(kind: str) -> Callable[[Bad, Subject], str]:
    def answer(bad: Bad, subject: Subject) -> str:
        if bad.shaped or bad.call or bad.dt != STEP:
            return "-"
        path = subject.folder / f"{subject.system.name}.fmu"
        subject.once("fmu", lambda: mbs.export.fmu(subject.system, path))
        folder = subject.once(
            "unpacked", lambda: fmpy.extract(str(path), str(subject.folder / "fmu"))
        )
        description = subject.once("described", lambda: fmpy.read_model_description(folder))
        values = moved(bad, subject)
        known = {variable.name for variable in description.modelVariables}
        # positions of dependent joints are guesses
        values = {solved(name, known): x for name, x in values.items()}
        said: list[str] = []

        def logger(*args: Any) -> None:
            text = args[-1]
            said.append(text.decode() if isinstance(text, bytes) else str(text))

        def simulated(start: dict[str, Any]) -> Any:
            return fmpy.simulate_fmu(
                folder,
                model_description=description,
                fmi_type=kind,
                stop_time=bad.dt,
                output_interval=bad.dt,
                start_values=start,
                logger=logger,
            )

        subject.once(kind, lambda: simulated({}))
        said.clear()
        try:
            rows = simulated(values)
        except Exception:
            # the last line is fmpy's own
            assert any("; " in text or "is not finite" in text for text in said), said
            return "status"
        assert set(values) <= known
        assert all(np.isfinite(rows[name]).all() for name in rows.dtype.names)
        return closes(subject, values, {n: rows[n][0] for n in rows.dtype.names})

    return answer


def solved(name: str, known: set[str]) -> str:
    """The variable of an FMU that sets a position."""
    guess = name.removesuffix(".q") + ".solved"
    return guess if guess in known else name


def closes(subject: Subject, values: dict[str, Any], start: dict[str, float]) -> str:
    """`closes` where a number is that of closed loops, whatever the dependent joints said."""
    if not subject.system.is_closed:
        return "number"
    q = [start[f"{c.name}.q"] for c in subject.system.coordinates]
    p = [values.get(x.name, x.default) for x in subject.system.parameters]
    assert np.abs(mbs.loops.closure_residual(subject.system)(q, p).full()).max() < 1e-9
    return "closes"


def run(bad: Bad, subject: Subject) -> str:
    if bad.call not in (None, unknown) or bad.dt != STEP:
        return "-"
    system = subject.system
    subject.once("run", lambda: mbs.simulate.run(system, 0.02, quiet=True))
    options: dict[str, Any] = {}
    if bad.shaped:
        options["q0"] = bad.shaped[1](subject.good["q"])
    elif bad.call:
        options["q0"] = {"torque": 0.1}
    else:
        for name, x in moved(bad, subject).items():
            key = {"q": "q0", "v": "v0", "tau": "tau"}.get(name.split(".")[-1], "parameters")
            name = name if key == "parameters" else name.rsplit(".", 1)[0]
            options.setdefault(key, {})[name] = x
    kept = []
    word = refusal(lambda: kept.append(mbs.simulate.run(system, 0.02, quiet=True, **options)))
    if word == "error":
        return word
    start = {n: kept[0][n][0] for n in kept[0].units}
    return closes(subject, options.get("parameters", {}), start)


def sweep(bad: Bad, subject: Subject) -> str:
    if bad.call not in (None, unknown) or bad.dt != STEP:
        return "-"
    system = subject.system
    options: dict[str, Any] = {}
    cases: list[dict[str, Any]] = [{}, {"torque": 0.1} if bad.call else moved(bad, subject), {}]
    if bad.shaped:
        options["q0"], cases = bad.shaped[1](subject.good["q"]), [{}]
    try:
        found = mbs.simulate.sweep(system, cases, 0.02, quiet=True, **options)
    except MbsError:
        return refusal(lambda: mbs.simulate.sweep(system, cases, 0.02, quiet=True, **options))
    failed = found.failures
    if bad.shaped:
        require_sentence(failed[0])
        values = bad.shaped[1](subject.good["q"])
        if len(values) != len(subject.good["q"]) or np.ndim(values) > 1:
            return "error"
        # as values of a grid
        return refusal(lambda: mbs.simulate.sweep(system, {"bend.q": values}, 0.02, quiet=True))
    assert not {0, 2} & set(failed), failed
    if 1 in failed:
        require_sentence(failed[1])
        return "error"
    row = found[1]
    start = {n: row[n][0] for n in row.units}
    return closes(subject, bad.values, start)


COLUMNS: dict[str, list[Callable[[Bad, Subject], str]]] = {
    "call by place or name, `expand`, `map`": [
        model_path(path) for path in ("call", "by name", "expand", "map")
    ],
    "`compiled`, exact or fast": [model_path("compiled"), model_path("fast")],
    "pickled, compiled or not": [model_path("pickled"), model_path("pickled, compiled")],
    "`batch`": [rows_of_batch],
    "`step` in a batch": [rows_of_step],
    "C library": [c_library],
    "FMU, Co-Simulation": [fmu("CoSimulation")],
    "FMU, Model Exchange": [fmu("ModelExchange")],
    "`simulate.run`": [run],
    "`sweep`": [sweep],
}


def answers(row: str, column: str, subjects: dict[str, Subject]) -> set[str]:
    bad = ROWS[row]
    return {answer(bad, subjects[bad.of]) for answer in COLUMNS[column]}


def table() -> tuple[list[str], dict[str, list[str]]]:
    """Columns, and rows with their words, of the first table of the page."""
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in PAGE.read_text(encoding="utf-8").split("## Arguments")[0].splitlines()
        if line.startswith("|") and line.count("|") == len(COLUMNS) + 2
    ]
    return rows[0][1:], {row[0]: row[1:] for row in rows[2:]}


def test_the_table_has_every_row_and_column():
    columns, rows = table()
    assert columns == list(COLUMNS)
    assert list(rows) == list(ROWS)


@pytest.mark.parametrize("row", ROWS)
def test_row(row, subjects):
    """Each word is what happens; none of them is a plain number."""
    columns, rows = table()
    wanted = dict(zip(columns, rows[row], strict=True))
    bad = ROWS[row]
    found = {
        column: "/".join(sorted({answer(bad, subjects[bad.of]) for answer in COLUMNS[column]}))
        for column in columns
    }
    assert found == wanted
    assert "number" not in wanted.values()


def test_a_start_of_all_positions_is_not_a_guess(subjects):
    """Where `closes` does not hold, as the page says."""
    system = subjects["loop"].system
    q = np.array(system.configuration)
    mbs.simulate.run(system, 0.01, q0=q, quiet=True)
    for away in (0.1, 1e-4):
        wrong = q + away * np.eye(3)[0]
        assert (
            refusal(lambda q0=wrong: mbs.simulate.run(system, 0.01, q0=q0, quiet=True)) == "error"
        )


def test_columns_are_states(subjects):
    """Of a model, where rows are those of a batch."""
    arm = subjects["arm"]
    one = arm.model(*arm.good.values()).full()
    rows = [np.column_stack([x] * 3) for x in arm.good.values()]
    assert arm.model(*rows).full() == pytest.approx(np.tile(one, 3), rel=1e-12)
    many = mbs.native.batch(arm.model)(*(x.T for x in rows))
    assert many == pytest.approx(np.tile(one, 3).T, rel=1e-9)
