"""`python -m mbs` as a process: help, version, pipes, completion, what it loads."""

import io
import json
import os
import subprocess
import sys

import pytest

import mbs
from mbs.app.cli import completion, main
from mbs.app.cli.application import application

HEAVY = ("casadi", "numpy", "sympy", "fmpy", "matplotlib", "nicegui", "mujoco", "scipy")


def mbs_process(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "mbs", *words],
        capture_output=True,
        text=True,
        encoding="utf-8",
        env={**os.environ, "PYTHONIOENCODING": "utf-8", "PYTHONWARNINGS": "error", **environment},
        check=False,
    )


def test_version_and_one_command() -> None:
    assert mbs_process("--version").stdout == f"mbs {mbs.__version__}\n"
    answer = mbs_process("robots", "--json")
    assert (answer.returncode, answer.stderr) == (0, "")
    assert "puma560" in [row["name"] for row in json.loads(answer.stdout)]
    answer = mbs_process("show", "nothing")
    assert (answer.returncode, answer.stdout) == (1, "")
    assert "Traceback" not in answer.stderr


def test_help_loads_no_package_of_numbers() -> None:
    code = (
        "import json, sys\nfrom mbs.app.cli import main\nsys.argv = ['mbs', '--help']\n"
        "try:\n    main()\nfinally:\n    print(json.dumps(sorted(sys.modules)), file=sys.stderr)"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, encoding="utf-8", check=True
    )
    loaded = set(json.loads(answer.stderr.splitlines()[-1]))
    assert "solve-ik" in answer.stdout
    assert loaded & set(HEAVY) == set()
    assert {name for name in loaded if name.startswith("mbs.models")} == set()


def test_a_reader_that_goes_away_is_no_error_to_read() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    answer = subprocess.run(
        [sys.executable, "-m", "mbs", "robots", "--json"],
        stdout=writing,
        stderr=subprocess.PIPE,
        check=False,
    )
    os.close(writing)
    assert (answer.returncode, answer.stderr) == (1, b"")


def _main_that_meets(error: Exception, monkeypatch) -> object:
    def broken(**_: object) -> None:
        raise error

    monkeypatch.setattr("mbs.app.cli.application.application", broken)
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO()))
    monkeypatch.setattr(sys, "stderr", io.TextIOWrapper(io.BytesIO()))
    with pytest.raises(SystemExit) as left:
        main()
    return left.value.code


def test_a_fault_of_mbs_is_a_sentence_and_a_traceback_where_it_is_wanted(monkeypatch) -> None:
    monkeypatch.delenv("MBS_TRACEBACK", raising=False)
    told = str(_main_that_meets(KeyError("gamma"), monkeypatch))
    assert told.startswith("mbs: this is a fault of mbs itself (KeyError: 'gamma'); please report")
    gone = FileNotFoundError(2, "No such file or directory", "a.csv")
    assert _main_that_meets(gone, monkeypatch) == "mbs: a.csv: No such file or directory"
    monkeypatch.setenv("MBS_TRACEBACK", "1")
    with pytest.raises(KeyError):
        _main_that_meets(KeyError("gamma"), monkeypatch)


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("mbs show pum", {"puma560"}),
        ("mbs model rx90 igm", {"igm-pieper", "igm-paul", "igm-general"}),
        ("mbs model rx90 jacobian --option f", {"frame=", "form="}),
        ("mbs model rx90 idm -l fo", {"fortran"}),
        ("mbs solve", {"solve-ik"}),
    ],
)
def test_the_shell_completes(line: str, offered: set[str], monkeypatch, capsys) -> None:
    words = line.split()
    monkeypatch.setenv("_MBS_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(len(words) - 1))
    with pytest.raises(SystemExit) as left:
        application(prog_name="mbs")
    assert left.value.code == 0
    assert set(capsys.readouterr().out.split()) == offered


def test_names_for_completion_are_those_of_the_catalogue() -> None:
    assert sorted(completion.robot_names()) == sorted(mbs.robots.catalogue())


def test_robot_files_are_offered(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rows").mkdir()
    for name in ("robot.toml", "rx.urdf", "notes.txt", "rows/a.par"):
        (tmp_path / name).touch()
    assert completion.robots("r") == ["rx90", "robot.toml", "rows/", "rx.urdf"]
    assert completion.robots("rows/") == ["rows/a.par"]


@pytest.mark.parametrize(
    "words",
    [
        *([info.name] for info in application.registered_commands),
        *(["export", kind] for kind in ("c", "fmu", "par", "toml", "html")),
    ],
    ids=" ".join,
)
def test_help_has_examples(command, words: list[str]) -> None:
    answer = command(*words, "--help")
    assert answer.code == 0
    example = f"$ mbs {' '.join(words)}"
    assert "Examples" in answer.out
    assert example in answer.out
