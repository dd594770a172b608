"""What users are told to install: the name of the distribution, extras and versions that exist."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from mbs.text import DISTRIBUTION, install_command

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = set(PROJECT["optional-dependencies"])
TEXTS = sorted(
    path
    for pattern in ("*.md", "*.cff", "Makefile", "pyproject.toml", ".ci/*")
    for path in ROOT.glob(pattern)
) + sorted(
    path
    for folder in ("mbs", "docs", "examples", "benchmarks")
    for path in (ROOT / folder).rglob("*")
    if path.suffix in (".py", ".md", ".toml", ".js", ".html", ".in", ".c", ".h")
)
OTHERS = {"pythonfmu", "exudyn", "ecospy"}
"""Packages of others that pages and benchmarks speak of; none of them is needed by this one."""
_INSTALL = re.compile(r"pip[\s#]+install[\s#]+(?!--)(?:-e[\s#]+)?(\"[^\"\n]*\"|[\w.\[\],-]+)")
_OWN = re.compile(r"(?:casadi-mbs|\.)\[([a-z,]+)\]")


def wanted(text: str) -> list[str]:
    """What the `pip install` lines of a text name."""
    return [name.strip('"') for name in _INSTALL.findall(text)]


def test_what_counts_as_a_line_that_installs() -> None:
    assert wanted('pip install "mbs[app]" or pip install -e ".[app]"') == ["mbs[app]", ".[app]"]
    assert wanted("run pip\n    install casadi-mbs[plot]. pip install\n# pandas") == [
        "casadi-mbs[plot].",
        "pandas",
    ]


def test_every_line_that_installs_names_an_extra_that_exists() -> None:
    assert len(TEXTS) > 400
    found = 0
    for path in TEXTS:
        for name in wanted(path.read_text(encoding="utf-8")):
            if name in OTHERS or (path.name == "text.py" and "{" in name):
                continue
            own = _OWN.fullmatch(name)
            assert own, f"{path}: pip install {name}"
            assert set(own[1].split(",")) <= EXTRAS, f"{path}: pip install {name}"
            found += 1
    assert found > 15


def test_no_text_takes_the_import_for_the_distribution() -> None:
    """`mbs` on the package index is another project."""
    wrong = re.compile(r"(?<![\w-])mbs\[(?!\w+\]\s*=)[a-z,]+\]|install +\"?mbs\b(?! into)")
    assert [str(path) for path in TEXTS if wrong.search(path.read_text(encoding="utf-8"))] == []


def test_messages_name_extras_that_exist() -> None:
    named: list[str] = []
    for path in (ROOT / "mbs").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
                continue
            if node.func.id in ("install_command", "optional_module"):
                extra = node.args[-1]
                if path.name == "result.py" and isinstance(extra, ast.Name):
                    continue  # optional_module itself, which passes its argument on
                assert isinstance(extra, ast.Constant), f"{path}:{node.lineno}"
                named.append(str(extra.value))
    assert len(named) > 15
    assert set(named) <= EXTRAS
    assert {
        *("app", "cross", "identify", "import", "jax", "meshes", "plot", "tables", "xacro")
    } == set(named)


def test_the_command_works_from_an_index_and_in_a_clone() -> None:
    assert PROJECT["name"] == DISTRIBUTION
    assert wanted(install_command("import")) == ["casadi-mbs[import]", ".[import]"]
    assert 'pip install -e ".[import]"' in install_command("import")


def test_extras_that_name_extras_name_this_distribution() -> None:
    named = [
        re.fullmatch(r"([\w-]+)\[([a-z,]+)\]", requirement)
        for requirements in PROJECT["optional-dependencies"].values()
        for requirement in requirements
        if "[" in requirement
    ]
    assert len(named) == 2
    for match in named:
        assert match
        assert match[1] == DISTRIBUTION
        assert set(match[2].split(",")) <= EXTRAS


def test_the_first_page_lists_every_extra() -> None:
    text = (ROOT / "docs" / "getting_started.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1] for line in text.splitlines() if line.startswith("| `")]
    assert {name for row in rows for name in re.findall(r"`(\w+)`", row)} == EXTRAS


def test_classifiers_name_the_versions_of_python_from_the_lowest_on() -> None:
    listed = re.findall(r"Python :: 3\.(\d+)", " ".join(PROJECT["classifiers"]))
    assert listed == [str(minor) for minor in range(11, 11 + len(listed))]
    assert PROJECT["requires-python"] == ">=3.11"
    assert len(listed) >= 3


def lowest(*extras: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(ROOT / ".ci" / "lowest"), *extras]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_lowest_versions_are_the_bounds_of_the_project() -> None:
    """Every requirement has a bound, and extras of extras are followed."""
    done = lowest(*EXTRAS)
    assert done.returncode == 0, done.stderr
    versions = dict(line.split("==") for line in done.stdout.splitlines())
    every = list(PROJECT["dependencies"])
    for requirements in PROJECT["optional-dependencies"].values():
        every += requirements
    foreign = {re.split(r"[>=!\[]", name)[0] for name in every} - {DISTRIBUTION}
    assert set(versions) == foreign
    assert f"fmpy>={versions['fmpy']}" in PROJECT["dependencies"]
    assert "matplotlib" not in lowest("import").stdout
    assert "matplotlib" in lowest("app").stdout


def test_an_extra_that_there_is_not_is_refused() -> None:
    done = lowest("plots")
    assert done.returncode != 0
    assert "'plots'" in done.stderr


@pytest.mark.parametrize("page", ["README.md", "docs/getting_started.md"])
def test_pages_show_both_ways(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert {".[plot,import]", "casadi-mbs[plot,import]"} <= set(wanted(text))
