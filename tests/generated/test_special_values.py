"""Texts at NaN, infinities and zeros against CasADi: each operation, and random graphs."""

import shutil

import pytest
from generated.special_values import (
    in_c,
    in_fortran,
    in_octave,
    in_python,
    in_rust,
    operations,
    random_function,
    require_same,
)

RUNS = {
    "c": ("gcc", in_c),
    "fortran": ("gfortran", in_fortran),
    "octave": ("octave-cli", in_octave),
    "python": ("python3", in_python),
    "rust": ("rustc", in_rust),
}


@pytest.mark.sweep
@pytest.mark.parametrize("language", RUNS)
def test_numbers_that_are_not_finite(language, tmp_path):
    tool, run = RUNS[language]
    if not shutil.which(tool):
        pytest.skip(f"{tool} is not installed")
    functions = [operations(language != "octave"), *(random_function(seed) for seed in range(12))]
    for function, columns in zip(functions, run(functions, tmp_path), strict=True):
        require_same(function, columns)
