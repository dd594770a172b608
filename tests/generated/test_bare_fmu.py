"""FMUs for microcontrollers: what their sources need, their numbers, and whose their memory is."""

import ctypes
import re
import shutil
import subprocess
import sys
import zipfile

import fmpy
import numpy as np
import pytest
from fmpy import fmi2
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.validation import validate_fmu
from support.catalogue_systems import catalogue_system
from support.sweeps import slow

import mbs
from mbs.components import Body, CoulombFriction, Revolute
from mbs.errors import ExportError
from mbs.native import find_compiler

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion")
STRICT += ("-Wno-strict-prototypes",)  # the header of FMI 3 has function types without prototypes
CORTEX = ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")
HEAP = {"malloc", "calloc", "realloc", "free"}
NEEDED = {"sin", "cos", "sqrt", "pow", "fabs", "fmax", "fmin", "floor", "rint", "atan2"}
NEEDED |= {"memcpy", "memset", "memcmp", "strlen", "strcmp", "strcpy"}
"""All that the FMUs of these tests call of the C library."""

SYSTEMS = ("puma560", "four_bar")


def export(folder, name="four_bar", fmi="2.0", target="bare", **options):
    system = catalogue_system(name) if isinstance(name, str) else name
    folder.mkdir(exist_ok=True)
    path = folder / f"{target}.fmu"
    return mbs.export.fmu(system, path, fmi=fmi, solver="rk4", target=target, **options)


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    """The folder of an FMU by name, version of FMI and target, made once."""
    made = {}

    def folder_of(*key):
        if key not in made:
            place = tmp_path_factory.mktemp("fmu")
            fmpy.extract(str(export(place, *key)), str(place / "fmu"))
            made[key] = place / "fmu"
        return made[key]

    return folder_of


def sources(folder):
    """The C files that stay where there is no heap."""
    return [file for file in sorted((folder / "sources").glob("*.c")) if file.name != "memory.c"]


# ---- what the sources need ----


@pytest.mark.skipif(not shutil.which("arm-none-eabi-gcc"), reason="no compiler for Cortex-M")
@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("name", ["four_bar", slow("puma560")])
def test_a_microcontroller_has_all_that_they_need(name, fmi, unpacked, tmp_path):
    files = sources(unpacked(name, fmi, "bare"))
    command = ["arm-none-eabi-gcc", *CORTEX, *STRICT, "-Werror", "-O2", "-c", *map(str, files)]
    answer = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (answer.returncode, answer.stderr) == (0, "")
    objects = [f"{file.stem}.o" for file in files]
    whole = ["arm-none-eabi-ld", "-r", *objects, "-o", "whole.o"]
    subprocess.run(whole, cwd=tmp_path, check=True)
    listed = subprocess.run(["arm-none-eabi-nm", "-u", "whole.o"], **_captured(tmp_path))
    calls = {call for call in listed.stdout.split() if call != "U"}
    own = {"mbs_allocate", "mbs_release"} if fmi == "3.0" else set()
    assert {call for call in calls if not call.startswith("__aeabi_")} <= NEEDED | own
    assert own <= calls
    sizes = subprocess.run(["arm-none-eabi-size", *objects], **_captured(tmp_path))
    rows = [line.split() for line in sizes.stdout.splitlines()[1:]]
    assert [(row[1], row[2]) for row in rows] == [("0", "0")] * len(files)  # data, bss


def _captured(folder):
    return {"cwd": folder, "check": True, "capture_output": True, "text": True}


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_no_source_but_that_of_the_heap_names_it(fmi, unpacked):
    folder = unpacked("four_bar", fmi, "bare")
    words = re.compile(r"\b(malloc|calloc|realloc|free|\w*printf|stdio|stdlib)\b")
    files = sorted((folder / "sources").glob("*.[ch]"))
    for file in (file for file in files if not file.name.startswith(f"fmi{fmi[0]}F")):
        code = re.sub(r"/\*.*?\*/", "", file.read_text(), flags=re.DOTALL)
        assert bool(words.search(code)) == (file.name == "memory.c"), file.name
    assert (folder / "sources" / "memory.c").exists() == (fmi == "3.0")


@pytest.mark.skipif(sys.platform != "linux", reason="nm lists symbols of ELF")
@pytest.mark.skipif(not shutil.which("nm"), reason="there is no nm")
@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_the_library_has_its_memory_from_the_importer(fmi, unpacked):
    library = next((unpacked("four_bar", fmi, "bare") / "binaries").glob("*/*.so"))
    listed = subprocess.run(["nm", "-D", "-u", str(library)], **_captured(library.parent))
    calls = {call.split("@")[0] for call in listed.stdout.split() if call not in "Uw"}
    assert {"sin", "memcpy"} <= calls
    assert not {call for call in calls if "printf" in call}
    assert calls & HEAP == (set() if fmi == "2.0" else {"malloc", "free"})


@pytest.mark.skipif(not shutil.which("cppcheck"), reason="cppcheck is not installed")
@pytest.mark.parametrize("fmi", [slow("2.0"), "3.0"])
def test_a_static_checker_finds_nothing(fmi, unpacked):
    folder = unpacked("four_bar", fmi, "bare") / "sources"
    text = (folder / "model.h").read_text()
    names = ("MODEL_ARRAYS", "MODEL_RODAS", "MODEL_ADJOINT", "MODEL_TREE", "MODEL_TREE_OUTSIDE")
    command = ["cppcheck", "--error-exitcode=1", "--enable=warning,portability", "--quiet"]
    command += [f"-U{name}" for name in names if f"#define {name}" not in text]
    command += ["--std=c99", str(folder)]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (answer.returncode, answer.stderr) == (0, "")


@pytest.mark.parametrize("fmi", [slow("2.0"), "3.0"])
def test_zig_takes_them_for_a_processor_without_an_fpu(fmi, unpacked, tmp_path):
    pytest.importorskip("ziglang")
    command = [sys.executable, "-m", "ziglang", "cc", "-target", "arm-linux-musleabi", *STRICT]
    command += ["-Wno-strict-prototypes"]  # of two callbacks in the header of FMI 3.0
    command += ["-Werror", "-O2", "-c"]
    for file in sources(unpacked("four_bar", fmi, "bare")):
        call = [*command, str(file), "-o", f"{file.stem}.o"]
        answer = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (answer.returncode, answer.stderr) == (0, "")


# ---- the numbers ----


def opened(folder, fmi, callbacks=None):
    description = fmpy.read_model_description(str(folder))
    instance = (FMU2Slave if fmi == "2.0" else FMU3Slave)(
        guid=description.guid,
        unzipDirectory=str(folder),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="one",
    )
    if fmi == "2.0":
        instance.instantiate(callbacks=callbacks)
        instance.setupExperiment(startTime=0.0)
    else:
        instance.instantiate()
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    return instance, {v.name: v.valueReference for v in description.modelVariables}


def moved(instance, fmi, references, names, inputs, steps):
    """Rows of values after steps of different lengths, the inputs held over each."""
    put, get = (
        (instance.setReal, instance.getReal)
        if fmi == "2.0"
        else (instance.setFloat64, instance.getFloat64)
    )
    time, rows = 0.0, []
    for u, h in zip(inputs, steps, strict=True):
        if len(u):
            put([references[name] for name in names[0]], list(u))
        instance.doStep(time, h)
        time = time + h
        rows.append(get([references[name] for name in names[1]]))
    return np.array(rows)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("name", SYSTEMS)
def test_a_motion_has_the_bits_of_the_hosted_fmu(name, fmi, unpacked):
    system = catalogue_system(name)
    shown = [f"{c.name}.q" for c in system.coordinates]
    shown += [f"{s.name}.{kind}" for kind in "va" for s in system.velocity_coordinates]
    efforts = [f"{s.name}.tau" for s in system.velocity_coordinates if s.name in _driven(system)]
    rng = np.random.default_rng(5)
    inputs, steps = rng.uniform(-2, 2, (150, len(efforts))), rng.uniform(0.0004, 0.012, 150)
    rows = []
    for target in ("hosted", "bare"):
        instance, references = opened(unpacked(name, fmi, target), fmi)
        rows.append(moved(instance, fmi, references, (efforts, shown), inputs, steps))
        instance.terminate()
        instance.freeInstance()
    np.testing.assert_array_equal(rows[1], rows[0])
    assert np.ptp(rows[1], axis=0).max() > 0.1  # it moves


def _driven(system):
    return {"puma560": [f"j{k}" for k in range(1, 7)], "four_bar": ["j1"]}[system.name]


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_it_is_an_fmu_for_co_simulation_alone(fmi, unpacked):
    folder = unpacked("four_bar", fmi, "bare")
    assert validate_fmu(str(folder.parent / "bare.fmu")) == []
    description = fmpy.read_model_description(str(folder))
    assert description.modelExchange is None
    assert description.coSimulation.canGetAndSetFMUstate
    if fmi == "2.0":
        assert not description.coSimulation.canNotUseMemoryManagementFunctions
        return
    instance = FMU3Model(
        guid=description.guid,
        unzipDirectory=str(folder),
        modelIdentifier="four_bar",
        instanceName="one",
    )
    with pytest.raises(Exception, match=r"[Ii]nstantiate"):
        instance.instantiate()


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_states_are_saved_and_come_back(fmi, unpacked):
    instance, references = opened(unpacked("four_bar", fmi, "bare"), fmi)
    word = "FMUstate" if fmi == "2.0" else "FMUState"
    read = getattr(instance, "deSerializeFMUstate" if fmi == "2.0" else "deserializeFMUState")
    save, put, free, write = (
        getattr(instance, f"{verb}{word}") for verb in ("get", "set", "free", "serialize")
    )
    names = ([], ["j1.q", "j2.q", "j4.v"])
    none, steps = np.zeros((20, 0)), [0.01] * 20
    moved(instance, fmi, references, names, none, steps)
    state = save()

    def onwards():
        time, rows = 0.2, []
        for _ in range(20):
            instance.doStep(time, 0.01)
            time += 0.01
            get = instance.getReal if fmi == "2.0" else instance.getFloat64
            rows.append(get([references[name] for name in names[1]]))
        return np.array(rows)

    first = onwards()
    put(state)
    np.testing.assert_array_equal(onwards(), first)
    other = read(write(state))
    put(other)
    np.testing.assert_array_equal(onwards(), first)
    for kept in (state, other):
        free(kept)


# ---- whose the memory is ----


class Heap:
    """Callbacks that count what they give, and give nothing after `limit` calls."""

    def __init__(self, limit=100):
        self.given, self.sizes, self.messages = {}, [], []
        self.limit = limit
        self.allocate = fmi2.fmi2CallbackAllocateMemoryTYPE(self._allocate)
        self.free = fmi2.fmi2CallbackFreeMemoryTYPE(self._free)
        self.log = fmi2.fmi2CallbackLoggerTYPE(self._log)
        self.callbacks = fmi2.fmi2CallbackFunctions(
            logger=self.log, allocateMemory=self.allocate, freeMemory=self.free
        )

    def _allocate(self, count, size):
        if len(self.sizes) >= self.limit:
            return None
        self.sizes.append(count * size)
        block = ctypes.create_string_buffer(count * size + 1)
        self.given[ctypes.addressof(block)] = block
        return ctypes.addressof(block)

    def _free(self, address):
        del self.given[address]

    def _log(self, environment, instance, status, category, message):
        self.messages.append(message.decode())


def test_callbacks_of_fmi_2_give_all_memory(unpacked):
    heap = Heap()
    instance, _ = opened(unpacked("four_bar", "2.0", "bare"), "2.0", heap.callbacks)
    assert len(heap.given) == 1
    instance.doStep(0.0, 0.01)
    state = instance.getFMUstate()
    assert len(heap.given) == 2
    other = instance.deSerializeFMUstate(instance.serializeFMUstate(state))
    assert len(heap.given) == 3
    instance.freeFMUstate(state)
    instance.freeFMUstate(other)
    instance.terminate()
    instance.freeInstance()
    assert heap.given == {}
    assert len(heap.sizes) == 3  # and none while it ran


def test_where_no_memory_is_left_a_sentence_says_so(unpacked):
    none, one = Heap(0), Heap(1)
    folder = unpacked("four_bar", "2.0", "bare")
    with pytest.raises(Exception, match=r"[Ii]nstantiate"):
        opened(folder, "2.0", none.callbacks)
    without = fmi2.fmi2CallbackFunctions(logger=one.log)
    with pytest.raises(Exception, match=r"[Ii]nstantiate"):
        opened(folder, "2.0", without)
    instance, _ = opened(folder, "2.0", one.callbacks)
    with pytest.raises(fmpy.fmi1.FMICallException):
        instance.getFMUstate()


FIRMWARE = """\
#include <stdio.h>
#include <string.h>
#include "fmi3_face.h"
#include "memory.h"

static union { char bytes[INSTANCE_SIZE(3)]; double aligned; } one;
static int taken;

void *mbs_allocate(void *environment, size_t size) {
    (void)environment;
    return !taken++ && size <= sizeof one ? &one : NULL;
}

void mbs_release(void *environment, void *memory) {
    (void)environment;
    taken -= memory == (void *)&one;
}

static void tell(fmi3InstanceEnvironment e, fmi3Status s, fmi3String c, fmi3String message) {
    (void)e, (void)s, (void)c;
    printf("%s\\n", message);
}

int main(void) {
    static const fmi3ValueReference shown[] = {REFERENCES};
    enum { COUNT = sizeof shown / sizeof *shown };
    fmi3Float64 q[COUNT], last;
    fmi3Boolean event, stop, early;
    fmi3FMUState state = NULL;
    fmi3Instance c = fmi3InstantiateCoSimulation("one", MODEL_GUID, "", 0, 0, 0, 0, NULL, 0, NULL,
                                                 tell, NULL);
    size_t k;
    if (fmi3InstantiateCoSimulation("two", MODEL_GUID, "", 0, 0, 0, 0, NULL, 0, NULL, tell, NULL))
        return 1;
    if (!c || fmi3EnterInitializationMode(c, 0, 0, 0, 0, 0)) return 2;
    if (fmi3ExitInitializationMode(c)) return 2;
    for (k = 0; k < 100; k++)
        if (fmi3DoStep(c, (double)k * 0.01, 0.01, 1, &event, &stop, &early, &last)) return 3;
    if (fmi3GetFMUState(c, &state) != fmi3Error) return 4;
    if (fmi3GetFloat64(c, shown, COUNT, q, COUNT)) return 5;
    for (k = 0; k < COUNT; k++) printf("%.17g\\n", q[k]);
    fmi3FreeInstance(c);
    return taken != 2;
}
"""


def test_a_program_gives_its_own_memory_to_fmi_3(unpacked, tmp_path):
    """No heap: one instance in a static array, and a second one has nowhere to be."""
    folder = unpacked("four_bar", "3.0", "bare")
    instance, references = opened(folder, "3.0")
    names = ["j1.q", "j2.q", "j1.v", "j4.a"]
    numbers = ", ".join(str(references[name]) for name in names)
    (tmp_path / "firmware.c").write_text(FIRMWARE.replace("REFERENCES", numbers))
    command = [*find_compiler().command, *STRICT, "-Werror", "-O2", "-ffp-contract=off"]
    command += [f"-I{folder / 'sources'}", "firmware.c", *map(str, sources(folder))]
    subprocess.run([*command, "-o", "firmware", "-lm"], cwd=tmp_path, check=True)
    answer = subprocess.run([tmp_path / "firmware"], capture_output=True, text=True, check=False)
    lines = answer.stdout.splitlines()
    assert (answer.returncode, answer.stderr) == (0, ""), lines
    assert lines[:2] == ["no memory is left", "one: no memory is left to save the state"]
    for k in range(100):
        instance.doStep(k * 0.01, 0.01)
    wanted = instance.getFloat64([references[name] for name in names])
    assert [float(line) for line in lines[2:]] == list(wanted)


# ---- messages without stdio ----


@pytest.fixture(scope="module")
def message(unpacked, tmp_path_factory):
    """`message_number`: text of a number with so many digits."""
    folder = tmp_path_factory.mktemp("message")
    source = unpacked("four_bar", "2.0", "bare") / "sources" / "message.c"
    command = [*find_compiler().command, "-O2", "-std=c99", "-fPIC", "-shared", str(source)]
    subprocess.run([*command, "-o", str(folder / "message.so"), "-lm"], check=True)
    library = ctypes.CDLL(str(folder / "message.so"))

    class Message(ctypes.Structure):
        _fields_ = (
            ("text", ctypes.c_char_p),
            ("size", ctypes.c_size_t),
            ("length", ctypes.c_size_t),
        )

    def text_of(value, digits, size=100):
        own, buffer = Message(), ctypes.create_string_buffer(size)
        library.message_begin(ctypes.byref(own), buffer, ctypes.c_size_t(size))
        library.message_number(ctypes.byref(own), ctypes.c_double(value), digits)
        return buffer.value.decode()

    return text_of


def test_numbers_are_written_as_printf_does(message):
    rng = np.random.default_rng(2)
    values = [0.0, -0.0, 1.0, 10.0, 0.1, 1e-4, 1e-5, 999999.5, 1e6, 123456789.0, 0.3, -2.5, 1e22]
    values += [1e100, 5e-324, 2.2250738585072014e-308, 1.7976931348623157e308]
    values += [float("inf"), -float("inf"), float("nan")]
    values += list(rng.standard_normal(2000) * 10.0 ** rng.uniform(-12, 12, 2000))
    values += list(np.round(rng.uniform(-100, 100, 2000), 3))
    for digits in (1, 3, 6, 9, 12):
        for value in values:
            found, wanted = message(value, digits), f"{value:.{digits}g}"
            if found != wanted:  # halves, to rounding of a product with a power of ten
                assert f"{float(found):.{digits}g}" == found
                off, least = abs(float(found) - value), abs(float(wanted) - value)
                assert least <= off <= least * (1 + 1e-3)


def test_what_does_not_fit_is_left_out(message):
    assert message(123456.0, 6, size=4) == "123"
    assert message(123456.0, 6, size=1) == ""


# ---- what is refused ----


def friction():
    m = mbs.Mechanism("rough", gravity=(0, 0, -9.81))
    arm = m.add(Body("arm", mass=1, com=(0.2, 0, 0), inertia=(0.1, 0.2, 0.3)))
    m.connect(m.world, Revolute("j", axis="y", actuated=True), arm)
    m.add(CoulombFriction("brake", joint="j", sliding=0.3))
    return m.assemble()


@pytest.mark.parametrize("solver", ["dopri5", "rodas"])
def test_other_solvers_are_refused(solver, tmp_path):
    system = catalogue_system("simple_pendulum")
    with pytest.raises(ExportError, match=f"solver is '{solver}', .*; use solver='rk4'"):
        mbs.export.fmu(system, tmp_path / "x.fmu", target="bare", solver=solver)
    assert not list(tmp_path.iterdir())


def test_events_are_refused(tmp_path):
    with pytest.raises(ExportError, match="have events, which target='bare' does not handle"):
        export(tmp_path, friction())


def test_an_unknown_target_is_refused(tmp_path):
    with pytest.raises(ExportError, match="target is 'arm'; use 'hosted' or 'bare'"):
        export(tmp_path, target="arm")


def test_c_of_its_own_is_refused(tmp_path):
    law = tmp_path / "law.c"
    law.write_text(
        "void law(double t, const double *q, const double *v, double *tau)"
        " { (void)t, (void)v; tau[0] = -q[0]; }\n"
    )
    with pytest.raises(ExportError, match=r"law\.c is C of its own, which target='bare' cannot"):
        export(tmp_path, controller="law", sources=[law])


def test_a_controller_of_scalar_operations_is_inside(tmp_path):
    path = export(tmp_path, controller=lambda t, q, v: {"j1": -3 * q[0] - v[0]})
    with zipfile.ZipFile(path) as archive:
        text = archive.read("sources/model.h").decode()
    assert "#define NU 0\n" in text
