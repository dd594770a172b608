"""Mistakes of users: one sentence on the standard error, an exit code, and no file."""

from pathlib import Path

import pytest

MISTAKES = [
    ("show puma", "robot 'puma' is not in the catalogue; did you mean 'puma560'?"),
    ("show rx90 -p L2=0.3", "rx90: parameter 'L2' is not used"),
    ("show none.toml", "none.toml: the file cannot be read (No such file or directory)"),
    ("model puma560 idmm", "there is no model 'idmm'; did you mean 'idm'"),
    ("model puma560 idm -l cobol", "idm of puma560 is not written in 'cobol'; use one of c,"),
    ("model puma560 jacobian --option frame=9", "jacobian of puma560: frame '9' is not offered"),
    ("model puma560 idm --option foo=1", "idm: there is no option 'foo'"),
    ("count planar_2r closure", "for mechanisms with closed loops; planar_2r has none"),
    ("simulate four_bar --q0 j1", "--q0: 'j1' is no NAME=VALUE; write it as j1=0.3"),
    ("simulate four_bar --q0 j9=1", "four_bar: there is no coordinate 'j9'; use one of j1, j2, j4"),
    ("simulate four_bar --tau j2=1", "four_bar: tau names 'j2', which has no motor"),
    ("simulate four_bar --tau j1=5*zz", "four_bar: tau of j1: there is no symbol 'zz' here"),
    ("simulate four_bar --duration -1 -o m.csv", "duration [s] is -1.0; give a finite positive"),
    ("simulate four_bar -o none/m.csv", "folder none does not exist; create it"),
    ("sweep four_bar --over j1.q=0:1", "grid of j1.q: '0:1' is no range; write FROM:TO:STEP"),
    ("solve-ik rx90", "solve-ik: say the pose in one way: --pose, --xyz"),
    ("solve-ik rx90 --xyz 0 0 a", "--xyz: 'a' is not a number; write one, such as 0.3 or pi/2"),
    ("identify rx90 none.csv", "record 'none.csv' cannot be read (No such file or directory)"),
    (
        "convert sr400 a.stl",
        "are not written; did you mean '.toml'? use one of .par, .toml, .urdf, .sdf, .xml",
    ),
    ("convert sr400 a.urdf", "closes a loop, which URDF cannot say; take it away first"),
    ("convert stewart_platform a.par", "a .par file"),
    ("export fmu four_bar none/x.fmu", "folder none does not exist; create it"),
    ("export c planar_2r x --model closure", "with closed loops; planar_2r has none"),
]


@pytest.mark.parametrize(("words", "sentence"), MISTAKES, ids=[words for words, _ in MISTAKES])
def test_a_mistake_is_one_sentence(command, tmp_path: Path, words: str, sentence: str) -> None:
    answer = command(*words.split())
    assert answer.code == 1
    assert answer.out == ""
    assert answer.err.startswith("mbs: ")
    assert answer.err.count("\n") == 1
    assert sentence in answer.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("shwo rx90", "No such command 'shwo'"),
        ("show", "Missing argument 'ROBOT'"),
        ("show rx90 --bogus", "No such option"),
        ("app --port 0", "'--port'"),
        ("sweep four_bar", "Missing option"),
    ],
)
def test_unknown_words_are_told_with_exit_code_two(command, words: str, sentence: str) -> None:
    answer = command(*words.split())
    assert answer.code == 2
    assert sentence in " ".join(answer.err.split())
    assert answer.out == ""


def test_a_record_that_is_none_is_refused(command, tmp_path: Path) -> None:
    (tmp_path / "bad.csv").write_bytes(b"\x00\xff not,a\nrecord\n")
    answer = command("identify", "planar_2r", "bad.csv", "--output", "e.csv")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("mbs: ")
    assert not (tmp_path / "e.csv").exists()


def test_a_file_that_stands_there_stays_when_the_run_fails(command, tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text("kept")
    assert command("simulate", "planar_2r", "--tau", "q1=1/0", "-o", "m.csv").code == 1
    assert (tmp_path / "m.csv").read_text() == "kept"
