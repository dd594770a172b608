"""The generated C, compiled here, against the Functions it came from: equal to the last bit."""

import subprocess

import casadi
import numpy as np
import pytest

import mbs
import mbs.models
from mbs.errors import ExportError, ModelError
from mbs.export.c_library import example_input
from mbs.native import compile_library, find_compiler

ROBOTS = ("puma560", "stanford", "two_branch_tree", "sr400", "four_bar", "five_bar")


def models(name):
    system = mbs.load(name).assemble()
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
