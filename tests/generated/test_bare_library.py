"""C for microcontrollers: what it needs, its numbers, and the motion that it steps through."""

import re
import shutil
import subprocess
import zipfile

import casadi
import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from support.bare_library import EXACT, Motion, called, header_number, loaded
from support.catalogue_systems import catalogue_system
from support.sweeps import slow

import mbs
from mbs.components import Body, Box, CoulombFriction, Free, Prismatic, Revolute
from mbs.errors import ExportError, ModelError
from mbs.native import c_code, find_compiler
from mbs.robots import n_four_bar

OK, NOT_FINITE, QUATERNION, PARAMETER, OPEN, UNDETERMINED, NO_RESULT = range(7)

STRICT = ("-std=c99", "-ffreestanding", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion")
STRICT += ("-Wdouble-promotion", "-Werror", "-c")
CORTEX = ("-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-d16")

NEEDED = {"sin", "cos", "sqrt", "fabs", "fmax", "fmin", "atan2", "memcpy", "memset"}
"""What the models of these tests call of the C library, with f in single precision."""


def cross_compiler():
    """That of microcontrollers where it is, else the one of this computer: command, nm and size."""
    if shutil.which("arm-none-eabi-gcc"):
        return ["arm-none-eabi-gcc", *CORTEX], "arm-none-eabi-nm", "arm-none-eabi-size"
    if not (shutil.which("nm") and shutil.which("size")):
        pytest.skip("there is neither arm-none-eabi-gcc nor nm")
    return [*find_compiler().command], "nm", "size"


def compiled(files, folder, flags=STRICT):
    """What the object files call, and their bytes of data and bss."""
    command, nm, size = cross_compiler()
    for file in files:
        answer = subprocess.run(
            [*command, *flags, str(file), "-o", f"{file.stem}.o"],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
        assert answer.stderr == ""
        assert answer.returncode == 0
    objects = [f"{file.stem}.o" for file in files]
    listed = subprocess.run([nm, "-u", *objects], cwd=folder, capture_output=True, text=True)
    sizes = subprocess.run([size, *objects], cwd=folder, capture_output=True, text=True)
    rows = [line.split() for line in sizes.stdout.splitlines()[1:]]
    return set(re.findall(r"U (\w+)", listed.stdout)), [(int(r[1]), int(r[2])) for r in rows]


def sources(folder):
    return [path for path in sorted(folder.glob("*.c")) if path.name != "example.c"]


def written(system, folder, **options):
    models = [mbs.models.inverse_dynamics(system), mbs.models.direct_dynamics(system)]
    return mbs.export.c_library([system, *models], folder, target="bare", **options)


def floating():
    """A body that floats, with an arm: a quaternion in its state, and parameters."""
    m = mbs.Mechanism("floating", gravity=(0, 0, -9.81))
    hull = m.add(Body("hull", mass=mbs.Parameter("M", 3.0), com=(0.1, 0, 0.05), inertia=(1, 2, 3)))
    arm = m.add(Body("arm", mass=1, com=(0.2, 0, 0), inertia=(0.1, 0.2, 0.3)))
    m.connect(m.world, Free("base"), hull)
    m.connect(hull, Revolute("j", axis="y", actuated=True), arm)
    return m.assemble()


# ---- what it needs ----


@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("name", ["four_bar", slow("puma560"), slow("five_bar")])
def test_it_needs_functions_of_numbers_alone(name, real, tmp_path):
    folder = written(catalogue_system(name), tmp_path / "lib", real=real)
    calls, memory = compiled(sources(folder), tmp_path)
    plain = {call.removesuffix("f") if real == "float" else call for call in calls}
    plain |= {call for call in calls if call in ("memcpy", "memset")}
    assert plain - {f"{call}" for call in NEEDED} <= {"_GLOBAL_OFFSET_TABLE_"}
    assert {"sin", "cos"} <= plain
    if real == "float":
        assert not calls & {"sin", "cos", "sqrt", "fabs"}
    assert memory == [(0, 0)] * len(memory)
    assert len(memory) == 2


def test_quaternions_and_parameters_compile_without_warnings(tmp_path):
    for real in ("double", "float"):
        folder = written(floating(), tmp_path / real, real=real)
        assert compiled(sources(folder), tmp_path)[1] == [(0, 0)] * 2


@pytest.mark.parametrize(("count", "least"), [(4, 0), slow(12, c_code._ONE_PIECE)])
def test_long_models_compile_without_warnings(monkeypatch, tmp_path, count, least):
    """Some thousand operations, in several pieces; fewer if shorter code is in pieces too."""
    monkeypatch.setattr(c_code, "_ONE_PIECE", least)
    system = n_four_bar(count).assemble()
    folder = mbs.export.c_library(system, tmp_path / "lib", target="bare", real="float")
    assert sum(path.read_text().count("NOINLINE void") for path in sources(folder)) > 5
    assert compiled(sources(folder), tmp_path)[1] == [(0, 0)] * 2


def test_what_drops_checks_is_refused(tmp_path):
    folder = written(catalogue_system("four_bar"), tmp_path / "lib")
    for file in sources(folder):
        command = [*find_compiler().command, "-ffast-math", "-fsyntax-only", str(file)]
        answer = subprocess.run(command, capture_output=True, text=True, check=False)
        assert "compile without -ffast-math" in answer.stderr


@pytest.mark.skipif(not shutil.which("g++"), reason="g++ is not installed")
def test_compilers_of_cpp_take_it(tmp_path):
    folder = written(catalogue_system("four_bar"), tmp_path / "lib")
    for file in sources(folder):
        command = ["g++", "-x", "c++", "-Wall", "-Werror", "-fsyntax-only", str(file)]
        answer = subprocess.run(command, capture_output=True, text=True, check=False)
        assert answer.stderr == ""


def test_the_equations_of_an_fmu_are_bare(tmp_path):
    """model.c and closure.c of a hosted FMU need what a bare library needs."""
    path = mbs.export.fmu(catalogue_system("four_bar"), tmp_path / "m.fmu", solver="rk4")
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path)
    files = [tmp_path / "sources" / "model.c", tmp_path / "sources" / "closure.c"]
    calls, memory = compiled(files, tmp_path, ("-std=c99", "-ffreestanding", "-O2", "-c"))
    assert {call for call in calls if not call.startswith(("mbs_", "MODEL_"))} <= NEEDED
    assert [bss for _, bss in memory] == [0, 0]


@pytest.mark.skipif(not shutil.which("cppcheck"), reason="cppcheck is not installed")
@pytest.mark.parametrize("kind", [slow("hosted"), slow("double"), "float", "fmu"])
def test_a_static_checker_finds_nothing(kind, tmp_path):
    system, undefined = catalogue_system("four_bar"), []
    if kind == "hosted":
        models = [mbs.models.inverse_dynamics(system), mbs.models.direct_dynamics(system).map(2)]
        folder = mbs.export.c_library(models, tmp_path / "lib")
    elif kind == "fmu":
        path = mbs.export.fmu(system, tmp_path / "m.fmu", solver="rk4")
        with zipfile.ZipFile(path) as archive:
            archive.extractall(tmp_path / "fmu")
        folder = tmp_path / "fmu" / "sources"
        text = (folder / "model.h").read_text()
        options = ("MODEL_ARRAYS", "MODEL_RODAS", "MODEL_ADJOINT")
        undefined = [f"-U{name}" for name in options if f"#define {name}" not in text]
    else:
        folder = written(system, tmp_path / "lib", real=kind)
    command = ["cppcheck", "--error-exitcode=1", "--enable=warning,portability", "--quiet"]
    command += ["--std=c99", *undefined, str(folder)]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (answer.returncode, answer.stderr) == (0, "")


# ---- the motion ----


def fmu_motion(system, folder, h, inputs, start=()):
    """Rows (q, v, a) of all joints after steps of an FMU whose solver takes the same steps."""
    path = mbs.export.fmu(system, folder / "m.fmu", solver="rk4", internal_step=h)
    description = fmpy.read_model_description(str(path))
    number = {v.name: v.valueReference for v in description.modelVariables}
    fmu = FMU2Slave(
        guid=description.guid,
        unzipDirectory=fmpy.extract(str(path), str(folder / "fmu")),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="fmu",
    )
    fmu.instantiate()
    fmu.setupExperiment(startTime=0.0)
    for name, value in dict(start).items():
        fmu.setReal([number[name]], [value])
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    efforts = [v.valueReference for v in description.modelVariables if v.causality == "input"]
    joints = [f"{c.name}.q" for c in system.coordinates]
    joints += [f"{s.name}.{kind}" for kind in "va" for s in system.velocity_coordinates]
    time, rows = 0.0, []
    for u in inputs:
        fmu.setReal(efforts, list(u))
        fmu.doStep(time, h)
        time = time + h
        rows.append(fmu.getReal([number[name] for name in joints]))
    fmu.terminate()
    fmu.freeInstance()
    return np.array(rows)


def stepped(motion, h, inputs):
    """The same rows of a bare library."""
    rows = []
    for u in inputs:
        assert motion.step(u, h) == OK
        status, seen = motion.motion(u)
        assert status == OK
        rows.append(np.concatenate(seen))
    return np.array(rows)


def efforts(count, steps):
    """Some, which jump every twentieth step."""
    rng = np.random.default_rng(3)
    return np.repeat(rng.uniform(-2, 2, (steps // 20, count)), 20, axis=0)


@pytest.mark.parametrize(
    ("name", "count", "steps"),
    [("simple_pendulum", 0, 200), ("puma560", 6, 200), ("four_bar", 1, 400), ("five_bar", 2, 200)],
)
def test_the_motion_is_that_of_an_fmu_to_the_last_bit(name, count, steps, tmp_path):
    system, inputs = catalogue_system(name), efforts(count, steps)
    folder = mbs.export.c_library(system, tmp_path / "lib", target="bare")
    motion = Motion(folder, loaded(folder), system)
    assert motion.start() == OK
    ours = stepped(motion, 0.001, inputs)
    np.testing.assert_array_equal(ours, fmu_motion(system, tmp_path, 0.001, inputs))
    assert np.abs(ours[-1] - ours[0]).max() > 0.1  # it moves
    assert motion.time == pytest.approx(0.001 * steps)


def test_starts_guesses_and_parameters_are_those_of_an_fmu(tmp_path):
    """The other branch of a four-bar, whose coupler has an unknown mass."""
    system = mbs.assembly.symbolic(catalogue_system("four_bar"), ["M2"])
    folder = mbs.export.c_library(system, tmp_path / "lib", target="bare")
    motion = Motion(folder, loaded(folder), system)
    assert motion.start([0.3, 1.5], [-1.2, -0.9], [5.0]) == OK
    ours = stepped(motion, 0.002, efforts(1, 100))
    start = {"j1.q": 0.3, "j1.v": 1.5, "j2.solved": -1.2, "j4.solved": -0.9, "M2": 5.0}
    theirs = fmu_motion(system, tmp_path, 0.002, efforts(1, 100), start)
    np.testing.assert_array_equal(ours, theirs)
    assert motion.start([0.3, 1.5], None, [5.0]) == OK
    assert np.abs(stepped(motion, 0.002, efforts(1, 100)) - ours).max() > 0.1


def test_a_body_that_floats_is_that_of_an_fmu(tmp_path):
    system = floating()
    folder = mbs.export.c_library(system, tmp_path / "lib", target="bare")
    motion = Motion(folder, loaded(folder), system)
    x = np.array([*system.configuration, *np.linspace(-1, 1, system.nv)])
    turned = x.copy()
    turned[3:7] = 0.5, 0.5, -0.5, 0.5
    assert motion.start(turned) == OK
    ours, states = [], []
    for u in efforts(1, 100):
        ours.append(stepped(motion, 0.005, [u])[0])
        states.append(motion.state[1 : 1 + x.size].copy())
    names = [f"{c.name}.q" for c in system.coordinates] + [
        f"{s.name}.v" for s in system.velocity_coordinates
    ]
    start = dict(zip(names, turned, strict=True))
    theirs = fmu_motion(system, tmp_path, 0.005, efforts(1, 100), start)
    np.testing.assert_array_equal(np.array(states), theirs[:, : x.size])
    np.testing.assert_array_equal(np.array(ours)[:, 7:], theirs[:, 7:])
    lengths = np.linalg.norm(np.array(ours)[:, 3:7], axis=1)  # shown at unit length
    assert lengths == pytest.approx(1, abs=1e-15)
    turned[3:7] *= 1.001
    assert motion.start(turned) == QUATERNION
    assert motion.start(x, None, [-1.0]) == PARAMETER


def test_the_order_of_the_method_is_four(tmp_path):
    system = catalogue_system("four_bar")
    folder = mbs.export.c_library(system, tmp_path / "lib", target="bare")
    motion, ends = Motion(folder, loaded(folder), system), []
    for count in (400, 800, 6400):
        assert motion.start([0.2, 3.0]) == OK
        ends.append(stepped(motion, 0.25 / count, [[1.0]] * count)[-1][:3])
    first, second = (np.abs(end - ends[-1]).max() for end in ends[:2])
    assert 14 < first / second < 20  # 16, and terms of the next order


# ---- what has no meaning ----


def test_steps_that_have_no_meaning(tmp_path):
    system = catalogue_system("four_bar")
    folder = mbs.export.c_library(system, tmp_path / "lib", target="bare")
    motion = Motion(folder, loaded(folder), system)
    assert motion.start([np.nan, 0.0]) == NOT_FINITE
    assert motion.step([0.0], 0.001) == NO_RESULT
    status, seen = motion.motion([0.0])
    assert status == NO_RESULT
    assert all(np.isnan(values).all() for values in seen)
    assert motion.start() == OK
    kept = motion.state.copy()
    for u, h in (([np.nan], 0.001), ([np.inf], 0.001), ([0.0], 0.0), ([0.0], -1.0)):
        assert motion.step(u, h) == NOT_FINITE
    assert motion.step([0.0], np.nan) == NOT_FINITE
    assert motion.step([1e305], 1.0) in (OPEN, UNDETERMINED, NO_RESULT)
    assert np.array_equal(motion.state[:3], kept[:3])  # t and x


def test_a_step_past_a_dead_centre_is_refused(tmp_path):
    """A four-bar that its rocker drives: at the end of its travel crank and rod align."""
    system = mbs.load("four_bar").assemble(active=["j4"])
    folder = mbs.export.c_library(system, tmp_path / "lib", target="bare")
    motion = Motion(folder, loaded(folder), system)
    assert motion.start() == OK
    statuses = [motion.step([-40.0], 0.01) for _ in range(300)]
    assert {OPEN, UNDETERMINED} & set(statuses)
    stopped = next(k for k, status in enumerate(statuses) if status)
    assert set(statuses[:stopped]) == {OK}
    assert motion.motion([-40.0])[0] == OK  # where it stood before
    J = mbs.loops.configuration_report(system, motion.motion([-40.0])[1][0])
    assert J.is_closed


def test_positions_that_nothing_reaches(tmp_path):
    system = mbs.load("four_bar").assemble(active=["j4"])
    folder = mbs.export.c_library(system, tmp_path / "lib", target="bare")
    motion = Motion(folder, loaded(folder), system)
    assert motion.start([-1.0, 0.0]) in (OPEN, UNDETERMINED)
    assert np.isnan(motion.state[1:3]).all()


def test_events_are_refused(tmp_path):
    m = mbs.Mechanism("slider")
    block = m.add(Box("b", length=0.1, width=0.1, mass=1))
    m.connect(m.world, Prismatic("s", axis="x", actuated=True), block.left)
    m.add(CoulombFriction("dry", joint="s", sliding=1.0))
    with pytest.raises(ModelError, match="events, which steps of a fixed length cannot follow"):
        mbs.export.c_library(m.assemble(), tmp_path / "lib", target="bare")
    assert list(tmp_path.iterdir()) == []


# ---- single precision ----


def test_single_precision_is_near(tmp_path):
    """Parts of the largest element: 6e-8 for each of some hundred operations, and what the inverse
    of the inertia matrix makes of it."""
    system = catalogue_system("puma560")
    idm, ddm = mbs.models.inverse_dynamics(system), mbs.models.direct_dynamics(system)
    folder = mbs.export.c_library([idm, ddm], tmp_path / "lib", target="bare", real="float")
    library, rng, errors = loaded(folder), np.random.default_rng(11), []
    for _ in range(200):
        values = [rng.uniform(-3, 3, 6) for _ in range(3)]
        for model in (idm, ddm):
            status, (found,) = called(folder, library, model, values, np.float32)
            exact = np.array(casadi.Function.call(model, values)[0]).ravel()
            errors.append(np.abs(found - exact).max() / np.abs(exact).max())
            assert status == OK
    assert max(errors) < 1e-4
    assert max(errors) > 1e-7  # it is single precision


def test_loops_in_single_precision(tmp_path):
    """The bound is wider, and configurations that are closed in double precision stay so."""
    system = catalogue_system("five_bar")
    ddm = mbs.models.direct_dynamics(system)
    folder = mbs.export.c_library([system, ddm], tmp_path / "lib", target="bare", real="float")
    library, q = loaded(folder), np.array(system.configuration)
    v, tau = [0.1, 0.2], [0.3, 0.4]
    for angle, wanted in ((0.0, OK), (1e-3, OPEN)):
        turned = q + angle * np.eye(len(q))[0]
        status, (a,) = called(folder, library, ddm, [turned, v, tau], np.float32)
        assert status == wanted
        if not status:
            assert a == pytest.approx(np.array(ddm(q, v, tau)).ravel(), rel=1e-4)
    assert np.isnan(a).all()


@pytest.mark.parametrize(("name", "count"), [("puma560", 6), ("four_bar", 1)])
def test_the_motion_in_single_precision_is_near(name, count, tmp_path):
    system, inputs, ends = catalogue_system(name), efforts(count, 500), []
    for real, dtype in (("double", np.float64), ("float", np.float32)):
        folder = mbs.export.c_library(system, tmp_path / real, target="bare", real=real)
        motion = Motion(folder, loaded(folder), system, dtype)
        assert motion.start() == OK
        ends.append(stepped(motion, 0.001, inputs)[-1][: system.nq])
    assert ends[1] == pytest.approx(ends[0], abs=1e-3)  # half a second of 500 roundings and Newton
    assert np.abs(ends[0] - system.configuration).max() > 0.05


def test_a_bound_of_more_than_zero_stays_one_in_single_precision(tmp_path):
    m = mbs.Mechanism("rod", gravity=(0, -9.81, 0))
    rod = m.add(Box("b", length=mbs.Parameter("L", 0.5), width=0.05, density=1000))
    m.connect(m.world, Revolute("j", axis="z"), rod.left)
    system = m.assemble()
    assert 0 < system.bounds["L"][0] < 1e-300
    idm = mbs.models.inverse_dynamics(system)
    for real, dtype in (("double", np.float64), ("float", np.float32)):
        folder = mbs.export.c_library(idm, tmp_path / real, target="bare", real=real)
        library = loaded(folder)
        for length, wanted in ((0.5, OK), (0.0, PARAMETER)):
            status, _ = called(folder, library, idm, [[0.1], [0], [0], [length]], dtype)
            assert status == wanted


# ---- what is asked for ----


def test_numbers_are_those_of_python_to_the_last_bit(tmp_path):
    system = catalogue_system("sr400")
    models = [mbs.models.inverse_dynamics(system), mbs.models.lagrange(system)]
    folder = mbs.export.c_library(models, tmp_path / "lib", target="bare")
    library, q = loaded(folder), system.configuration
    for model in models:
        values = [q, *(np.linspace(-1, 1, model.numel_in(k)) for k in range(1, model.n_in()))]
        status, outputs = called(folder, library, model, values)
        assert status == OK
        exact = casadi.Function.call(model, [casadi.DM(np.array(v)) for v in values])
        for found, value in zip(outputs, exact, strict=True):
            np.testing.assert_array_equal(found, np.array(value).ravel(order="F"))


def test_the_example_runs(tmp_path):
    folder = written(catalogue_system("four_bar"), tmp_path / "four_bar", real="float")
    flags = [flag for flag in EXACT if flag not in ("-fPIC", "-shared")]
    files = [*map(str, sources(folder)), "example.c"]
    command = [*find_compiler().command, *flags, "-Wall", "-Werror", *files, "-o", "example", "-lm"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    run = subprocess.run([folder / "example"], check=True, capture_output=True, text=True)
    assert [line.split()[0] for line in run.stdout.splitlines()] == ["idm", "ddm", "four_bar"]


def test_files_and_names(tmp_path):
    system = catalogue_system("four_bar")
    folder = mbs.export.c_library(
        {"left": system, "right": system}, tmp_path / "lib", target="bare"
    )
    names = {path.name for path in folder.iterdir()}
    assert names == {"lib.c", "lib.h", "left_step.c", "right_step.c", "example.c", "CMakeLists.txt"}
    assert (
        "add_library(lib lib.c left_step.c right_step.c)" in (folder / "CMakeLists.txt").read_text()
    )
    library = loaded(folder)
    for name in ("left", "right"):
        assert Motion(folder, library, system, name=name).start() == OK
    assert header_number(folder, "LEFT_STEP_SZ_W") > 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"target": "arduino"}, "target is 'arduino'; use 'hosted' or 'bare'"),
        ({"target": "bare", "real": "half"}, "real is 'half'; use 'double' or 'float'"),
        ({"real": "float"}, "real='float' is for bare libraries; add target='bare'"),
    ],
)
def test_options_that_are_none(options, message, tmp_path):
    idm = mbs.models.inverse_dynamics(catalogue_system("four_bar"))
    with pytest.raises(ExportError, match=message):
        mbs.export.c_library(idm, tmp_path / "lib", **options)
    assert list(tmp_path.iterdir()) == []


def test_names_that_meet(tmp_path):
    system = catalogue_system("four_bar")
    idm = mbs.models.inverse_dynamics(system)
    with pytest.raises(ModelError, match="lib_real is the type of numbers; give the function"):
        mbs.export.c_library({"lib_real": idm}, tmp_path / "lib", target="bare")
    with pytest.raises(ModelError, match=r"would both be arm_step\.c; choose another folder"):
        mbs.export.c_library({"arm": system}, tmp_path / "arm_step", target="bare")
    with pytest.raises(ModelError, match="'arm' and 'arm_step' would both make arm_step in C"):
        mbs.export.c_library({"arm": system, "arm_step": idm}, tmp_path / "x", target="bare")
    assert list(tmp_path.iterdir()) == []


def test_what_has_no_scalar_operations(tmp_path):
    z, p = casadi.SX.sym("z"), casadi.SX.sym("p")
    root = casadi.rootfinder("root", "newton", {"x": z, "p": p, "g": z * z - p})
    x = casadi.MX.sym("x")
    function = casadi.Function("f", [x], [root(x0=1, p=x)["x"]])
    with pytest.raises(ModelError, match="it is not made of scalar operations"):
        mbs.export.c_library(function, tmp_path / "lib", target="bare")
    assert list(tmp_path.iterdir()) == []
