"""A whole optimal control problem in acados, where its wheel (comma-deps-acados) is installed."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def solved(folder, *words):
    """What the problem gives, solved in a process that knows where acados is."""
    spec = importlib.util.find_spec("acados")
    if spec is None or not spec.submodule_search_locations:
        pytest.skip("acados is not installed")
    package = Path(spec.submodule_search_locations[0])
    places = {
        "ACADOS_SOURCE_DIR": package / "install",
        "ACADOS_PYTHON_INTERFACE_PATH": package / "acados_template",
        "LD_LIBRARY_PATH": package / "install" / "lib",
        "TERA_PATH": package / "install" / "bin" / "t_renderer",
        "PYTHONPATH": ROOT,
    }
    answer = subprocess.run(
        [sys.executable, str(ROOT / "tests" / "support" / "acados_arm.py"), *words],
        cwd=folder,
        env={**os.environ, **{name: str(place) for name, place in places.items()}},
        capture_output=True,
        text=True,
        check=False,
    )
    assert answer.returncode == 0, answer.stderr
    return json.loads(answer.stdout.splitlines()[-1])


@pytest.fixture(scope="module")
def explicit(tmp_path_factory):
    return solved(tmp_path_factory.mktemp("explicit"), "puma560", "reduced")


def test_acados_finds_the_least_effort_of_an_arm(explicit):
    """The defect is to our own step of Runge and Kutta, which acados's ERK is too."""
    found = explicit
    assert found["status"] == 0
    assert found["defect"] < 1e-12
    assert found["miss"] < 1e-12
    assert found["largest"] < 59.0  # no bound acts, so the least effort is that of equations alone
    assert found["slack"] < 1e-6


def test_the_implicit_form_finds_the_same(explicit, tmp_path):
    implicit = solved(tmp_path, "puma560", "index1")
    assert implicit["status"] == 0
    assert implicit["cost"] == pytest.approx(explicit["cost"], rel=1e-5)  # another integrator
    assert implicit["defect"] < 1e-3
