"""The generated C, compiled here, against the Functions it came from: equal to the last bit."""

import subprocess

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
import mbs.models
from mbs.errors import ExportError, ModelError
from mbs.export._c_library import example_input
from mbs.native import compile_library, find_compiler

ROBOTS = ("puma560", "stanford", "two_branch_tree", "sr400", "four_bar", "five_bar")


def models(name):
    system = catalogue_system(name)
    builders = (
        mbs.models.inverse_dynamics,
        mbs.models.direct_dynamics,
        mbs.models.inertia_matrix,
        mbs.models.lagrange,
        mbs.models.energy,
    )
    return [build(system) for build in builders]


def printed(folder):
    """What the example program prints: (function, output) -> numbers."""
    compiler = find_compiler()
    sources = [str(path) for path in folder.glob("*.c")]
    flags = ["-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Werror"]
    command = [*compiler.command, *flags, *sources, "-o", "example", "-lm"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    run = subprocess.run([folder / "example"], check=True, capture_output=True, text=True)
    rows = [line.split() for line in run.stdout.splitlines()]
    return {(row[0], row[1]): np.array([float(x) for x in row[2:]]) for row in rows}


@pytest.mark.sweep
@pytest.mark.parametrize("name", ROBOTS)
def test_example_program_equals_the_functions(name, tmp_path):
    functions = models(name)
    folder = mbs.export.c_library(functions, tmp_path / name)
    numbers = printed(folder)
    for function in functions:
        inputs = [example_input(function, k) for k in range(function.n_in())]
        for k, value in enumerate(casadi.Function.call(function, [casadi.DM(x) for x in inputs])):
            expected = np.array(value).ravel(order="F")
            ours = numbers[function.name(), function.name_out(k)]
            np.testing.assert_array_equal(ours, expected)


def test_files_and_prototypes(tmp_path):
    functions = models("two_branch_tree")[:1]
    folder = mbs.export.c_library(functions, tmp_path / "arm")
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["CMakeLists.txt", "arm.c", "arm.h", "example.c"]
    header = (folder / "arm.h").read_text()
    assert "int idm_eval(const double *q, const double *v, const double *a" in header
    assert "@param[in]  q  (7, 1)" in header
    assert "@param[out] tau  (7, 1)" in header


def test_nested_folders_are_made_and_rewritten(tmp_path):
    functions = models("four_bar")[:1]
    for _ in range(2):
        folder = mbs.export.c_library(functions, tmp_path / "build" / "deep" / "four_bar")
    assert (folder / "four_bar.c").exists()


def test_two_functions_of_one_name_are_refused(tmp_path):
    function = models("four_bar")[0]
    with pytest.raises(ModelError, match="two functions are named 'idm'"):
        mbs.export.c_library([function, function], tmp_path / "x")
    assert not (tmp_path / "x").exists()


def test_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ExportError, match="choose a folder that can be written"):
        mbs.export.c_library(models("four_bar")[:1], tmp_path / "file" / "lib")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_library_compiles_as_shared_object(tmp_path):
    folder = mbs.export.c_library(models("four_bar"), tmp_path / "four_bar")
    library = tmp_path / "four_bar.so"
    compile_library([folder / "four_bar.c"], include_dirs=[folder], output=library)
    assert library.stat().st_size > 1000


# ---- files that are not ours ----


@pytest.mark.parametrize("file", ["CMakeLists.txt", "example.c", "arm.c", "arm.h"])
def test_files_of_others_are_left_alone(tmp_path, file):
    folder = tmp_path / "arm"
    folder.mkdir()
    (folder / file).write_text("project(mine)\n")
    with pytest.raises(ExportError, match=f"{file} was not written by mbs and is left alone"):
        mbs.export.c_library(example(), folder)
    assert [path.name for path in folder.iterdir()] == [file]
    assert (folder / file).read_text() == "project(mine)\n"


def test_other_files_in_the_folder_do_not_matter(tmp_path):
    folder = tmp_path / "arm"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    mbs.export.c_library(example(), folder)
    assert mbs.export.c_library(example(), folder) == folder
    assert len(list(folder.iterdir())) == 5


# ---- names ----


def example(name="f", inputs=("x",), outputs=("y",)):
    symbols = [casadi.SX.sym(f"s{k}", 2) for k in range(len(inputs))]
    values = [casadi.sin(sum(symbols)) + k for k in range(len(outputs))]
    return casadi.Function(name, symbols, values, list(inputs), list(outputs))


def same_numbers(numbers, name, function):
    inputs = [example_input(function, k) for k in range(function.n_in())]
    for k, value in enumerate(casadi.Function.call(function, [casadi.DM(x) for x in inputs])):
        expected = np.array(value).ravel(order="F")
        np.testing.assert_array_equal(numbers[name, function.name_out(k)], expected)


@pytest.mark.parametrize(
    ("folder", "name"),
    [
        ("example", "example_models"),
        ("2r", "models_2r"),
        ("math", "math_models"),
        ("String", "String_models"),
        ("m", "m_models"),
        ("né à", "n___"),
        ("_", "models"),
        ("arm.v2", "arm_v2"),
    ],
)
def test_folders_of_any_name_compile(tmp_path, folder, name):
    target = mbs.export.c_library(example(), tmp_path / folder)
    assert {path.name for path in target.iterdir()} >= {f"{name}.h", f"{name}.c"}
    header = (target / f"{name}.h").read_text()
    assert f"#ifndef MBS_{name.upper()}_H\n" in header
    assert f"add_library({name} {name}.c)" in (target / "CMakeLists.txt").read_text()
    same_numbers(printed(target), "f", example())


def test_inputs_named_like_words_of_c(tmp_path):
    inputs = ("w", "int", "f", "printf", "k", "f_eval", "arg", "res", "j1", "F_SZ_W")
    function = example("f", inputs, ("y", "double", "w_", "iw"))
    target = mbs.export.c_library(function, tmp_path / "odd")
    assert "const double *w_, const double *int_" in (target / "odd.h").read_text()
    same_numbers(printed(target), "f", function)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("sin", "'sin' is a name of C; give another one, as in {'my_sin': function}"),
        ("int", "'int' is a name of C"),
        ("main", "'main' is a name of C"),
        ("class", "'class' is a name of C"),
        ("j0", "'j0' is a name of C"),
    ],
)
def test_functions_named_like_words_of_c(tmp_path, name, message):
    with pytest.raises(ModelError) as error:
        mbs.export.c_library(example(name), tmp_path / "lib")
    assert message in str(error.value)
    assert list(tmp_path.iterdir()) == []
    target = mbs.export.c_library({f"my_{name}": example(name)}, tmp_path / "lib")
    same_numbers(printed(target), f"my_{name}", example(name))


@pytest.mark.parametrize("names", [("f", "F"), ("f", "f_eval"), ("f", "f_work")])
def test_functions_whose_names_meet_in_c(tmp_path, names):
    with pytest.raises(ModelError, match="would both make"):
        mbs.export.c_library([example(name) for name in names], tmp_path / "lib")


def test_two_systems_share_a_library(tmp_path):
    left, right = (models(name)[0] for name in ("four_bar", "puma560"))
    given = {"left": left, "right": right}
    folder = mbs.export.c_library(given, tmp_path / "both")
    numbers = printed(folder)
    for name, function in given.items():
        same_numbers(numbers, name, function)
    header = (folder / "both.h").read_text()
    assert "/** left(q, " in header
    assert ": j1 [rad], " in header


def test_joint_names_cannot_end_a_comment(tmp_path):
    m = mbs.Mechanism("m")
    body = m.add(mbs.components.Body("b", mass=1, inertia=(1, 1, 1)))
    m.connect(m.world, mbs.components.Revolute("a*/b/*c\\"), body)
    function = mbs.models.inverse_dynamics(m.assemble())
    folder = mbs.export.c_library(function, tmp_path / "lib")
    same_numbers(printed(folder), "idm", function)


# ---- functions ----


def test_sparse_matrices_become_dense(tmp_path):
    x, s = casadi.SX.sym("x", 3), casadi.SX.sym("s", casadi.Sparsity.lower(2))
    function = casadi.Function("f", [x, s], [casadi.diag(x), casadi.mtimes(s, s)])
    folder = mbs.export.c_library(function, tmp_path / "sparse")
    numbers = printed(folder)
    same_numbers(numbers, "f", function)
    assert numbers["f", "o0"].size == 9


def test_code_that_casadi_cannot_write(tmp_path, capfd):
    z, p = casadi.SX.sym("z"), casadi.SX.sym("p")
    root = casadi.rootfinder("root", "newton", {"x": z, "p": p, "g": z * z - p})
    q = casadi.MX.sym("q")
    function = casadi.Function("f", [q], [root(x0=1, p=q)["x"]])
    with pytest.raises(ModelError, match=r"CasADi cannot write it as C \(.*by Newton steps"):
        mbs.export.c_library(function, tmp_path / "lib")
    assert list(tmp_path.iterdir()) == []
    capfd.readouterr()


@pytest.mark.parametrize(
    ("functions", "message"),
    [
        (None, "None is not a Function; give a casadi.Function"),
        ([None], "None is not a Function"),
        ({"f": None}, "None is not a Function"),
        ({3: example()}, "the name 3 is not a text"),
        ({"2f": example()}, "'2f' is no name of a function"),
        ({"jac": example()}, "'jac' is no name of a function"),
        ("idm", "'idm' is not a Function"),
        ([], "there is no function to write; give at least one"),
        ({}, "there is no function to write"),
    ],
)
def test_what_is_no_function(tmp_path, functions, message):
    with pytest.raises(ModelError, match=message):
        mbs.export.c_library(functions, tmp_path / "lib")
    assert list(tmp_path.iterdir()) == []


def test_a_system_is_no_function(tmp_path):
    with pytest.raises(ModelError, match="four_bar is a System, whose motion bare libraries have"):
        mbs.export.c_library(catalogue_system("four_bar"), tmp_path / "lib")
    with pytest.raises(ExportError, match="3 is not a path"):
        mbs.export.c_library(example(), 3)
