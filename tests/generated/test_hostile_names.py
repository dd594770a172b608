"""Names and sources that try to leave comments of generated text: nothing of them is code."""

import ast
import re
import shutil
import subprocess
import tomllib
import zipfile
from xml.etree import ElementTree

import casadi
import pytest
from casadi import SX, Function

import mbs
import mbs.models
from mbs import Mechanism
from mbs.components import Body, Revolute
from mbs.components.component import component_name
from mbs.errors import ModelError
from mbs.export.languages import LANGUAGES
from mbs.formats import FrameRow, InertiaRow, RobotTable, read_par, write_par, write_toml
from mbs.native import find_compiler

EVIL = "EVIL_CODE"
"""A word that stands in every text, and nowhere outside of comments and strings."""

ENDS = "\n\r\v\f\x1c\x1d\x1e\x85\u2028\u2029"
HOSTILE = {
    "slash after backslash": f"book *\\ void {EVIL}(void); \\*",
    "end": f"*/ {EVIL} /*",
    "spliced end": f"*\\\n/ {EVIL} /*",
    "trigraph end": f"*??/\n/ {EVIL} ??/",
    "hidden end": f"*\u200b/ {EVIL} /\u200b*",
    "full width end": f"\uff0a\uff0f {EVIL} \uff0f\uff0a",
    "full width backslash": f"*\uff3c {EVIL} \uff3c*",
    "last backslash": f"{EVIL} \\",
    "last trigraph": f"{EVIL} ??/",
    "brackets": f"*) {EVIL} (*",
    "double brackets": f"*)) {EVIL} ((** (*) ",
    "block of Matlab": f"\n%{{\n{EVIL}\n%}}\n",
    "block of Julia": f"=# {EVIL} #=",
    "docstring": f'""" \n{EVIL} = 1\n"""',
    "docstring by escape": f'\\""""\n{EVIL} = 1\n"""',
    "example of Rust": f"\n```\n{EVIL}();\n```\n",
    "string": f'", {EVIL}, "',
    "string by escape": f'\\", {EVIL}, \\"',
    "markup": f"--> ]]> <script>{EVIL}</script> <!--",
    "remark": f"' *)\n(* Value {EVIL} = 3 *)\n(* '",
    "table": f'"""\n[parameters]\n{EVIL} = 1\n"""',
    "end of the classic text": f"*=*\nEquations:\n{EVIL} = 1;\n",
    **{f"line end {ord(end):#x}": f"x{end}{EVIL}{end}" for end in ENDS},
    "right to left": f"\u202e\u2066 {EVIL} \u2069",
    "end of file": f"\x1a\x04 {EVIL}",
    "nul": f"\x00 {EVIL}",
}
names = pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE.keys())
TEXTS = [language for language in LANGUAGES if language != "octave"]


def arm(name, source):
    """A pendulum of a source; itself, its body and its joint bear one name."""
    m = Mechanism(name, source=source)
    body = m.add(Body(f"b{name}", mass=1, com=(0.1, 0, 0), inertia=(1, 1, 1)))
    m.connect(m.world, Revolute(name, axis="y"), body)
    return m.assemble()


def hostile_arm(text):
    """Its names are as readers of files make them of the text."""
    return arm(component_name(text), text)


def harmless_arm(text):
    """The same, its names the identifiers that languages make of them."""
    return arm(re.sub(r"\W", "_", component_name(text), flags=re.ASCII), "harmless")


def both_models(text):
    return [mbs.models.inverse_dynamics(make(text)) for make in (hostile_arm, harmless_arm)]


def c_tokens(source, path):
    """Return the words of a C text without its comments, which the preprocessor of gcc removes."""
    if not shutil.which("gcc"):
        pytest.skip("gcc is not installed")
    path.write_bytes(source.encode("utf-8"))
    command = ["gcc", "-std=c99", "-trigraphs", "-fpreprocessed", "-dD", "-E", "-P", str(path)]
    answer = subprocess.run(command, capture_output=True, check=True)
    assert b"comment" not in answer.stderr
    assert b"-Wtrigraphs" not in answer.stderr
    return answer.stdout.decode("utf-8").split()


def line_comments(mark):
    return lambda text: "\n".join(line.split(mark)[0] for line in text.splitlines())


def bracket_comments(text):
    """The text without its comments, which nest."""
    depth, left, k = 0, "", 0
    while k < len(text):
        pair = text[k : k + 2]
        if pair == "(*" or (pair == "*)" and depth):
            depth += 1 if pair == "(*" else -1
            k += 2
            continue
        left += "" if depth else text[k]
        k += 1
    assert depth == 0
    return left


def without_docstrings(text):
    return ast.unparse(ast.fix_missing_locations(_NoDocstrings().visit(ast.parse(text))))


class _NoDocstrings(ast.NodeTransformer):
    def visit_FunctionDef(self, node):
        assert ast.get_docstring(node)
        node.body = node.body[1:]
        return node


STRIPPED = {
    "fortran": line_comments("!"),
    "matlab": line_comments("%"),
    "maple": line_comments("#"),
    "mathematica": bracket_comments,
    "python": without_docstrings,
    "julia": line_comments("#"),
    "rust": line_comments("//"),
    "latex": line_comments("%"),
    "symoro": bracket_comments,
}


@pytest.mark.sweep
@names
@pytest.mark.parametrize("language", TEXTS)
def test_nothing_of_a_name_is_code(language, text, tmp_path):
    source, harmless = (mbs.export.code(model, language) for model in both_models(text))
    assert EVIL in source
    assert source.isascii()
    assert "".join(source.split("\n")).isprintable()
    if language == "c":
        left, wanted = (c_tokens(s, tmp_path / "m.c") for s in (source, harmless))
    else:
        if language != "symoro":  # whose comments have no escapes
            assert not any("\\" in line for line in source.splitlines() if "Data: " in line)
        left, wanted = (STRIPPED[language](s).split() for s in (source, harmless))
    assert left == wanted


COMPILERS = {
    "fortran": ("gfortran", "m.f90", ["gfortran", "-fsyntax-only", "-std=f2008", "-cpp"]),
    "rust": (
        "rustc",
        "m.rs",
        ["rustc", "--crate-type", "lib", "--emit", "metadata", "-D", "warnings"],
    ),
    "octave": (
        "octave-cli",
        "idm.m",
        ["octave-cli", "--norc", "--no-history", "--quiet", "--eval", "idm(1, 2, 3);"],
    ),
}


@pytest.mark.parametrize("language", COMPILERS)
def test_compilers_find_nothing_of_a_name(language, tmp_path):
    tool, file, command = COMPILERS[language]
    if not shutil.which(tool):
        pytest.skip(f"{tool} is not installed")
    everything = "\n".join(HOSTILE.values())
    (tmp_path / file).write_text(mbs.export.code(both_models(everything)[0], language))
    if language != "octave":
        command = [*command, file]
    answer = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (answer.returncode, answer.stderr) == (0, "")


@pytest.mark.sweep
@names
def test_c_library(text, tmp_path):
    folders = [
        mbs.export.c_library(model, tmp_path / n / "arm")
        for n, model in zip("ab", both_models(text), strict=True)
    ]
    for name in ("arm.c", "arm.h", "example.c"):
        left, wanted = (
            c_tokens((f / name).read_text(encoding="utf-8"), tmp_path / "m.c") for f in folders
        )
        assert left == wanted
    texts = [(f / "CMakeLists.txt").read_text() for f in folders]
    assert texts[0] == texts[1]


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_fmu(fmi, tmp_path):
    """All texts in one, since every FMU is compiled."""
    everything = "\n".join(HOSTILE.values())
    contents = []
    for name, system in (("a", hostile_arm(everything)), ("b", harmless_arm(everything))):
        path = mbs.export.fmu(system, tmp_path / f"{name}.fmu", fmi=fmi)
        with zipfile.ZipFile(path) as archive:
            contents.append({f: archive.read(f) for f in archive.namelist()})
    for file, data in contents[0].items():
        if file.endswith((".xml", ".svg")):
            ElementTree.fromstring(data)
        if file.endswith((".c", ".h")) and data != contents[1][file]:
            left, wanted = (
                [t for t in c_tokens(c[file].decode("utf-8"), tmp_path / "m.c")] for c in contents
            )
            assert _without_strings(left) == _without_strings(wanted), file
    assert b"<script>" not in contents[0]["documentation/index.html"]


def _without_strings(tokens):
    return re.sub(r'"(\\.|[^"\\])*"', '""', " ".join(tokens))


@names
def test_par_keeps_the_source_as_a_comment(text, tmp_path):
    table = RobotTable("arm", (FrameRow(0),), (InertiaRow(1, ZZ=1.0),), source=text)
    write_par(table, tmp_path / "arm.par")
    again = read_par(tmp_path / "arm.par")
    assert again.parameters == {}
    assert again.source
    written = (tmp_path / "arm.par").read_text(encoding="utf-8")
    assert EVIL in written
    assert EVIL not in bracket_comments(written)
    assert len(written.splitlines()) == len(written.split("\n")) - 1
    write_par(again, tmp_path / "again.par")
    assert (tmp_path / "again.par").read_text(encoding="utf-8") == written


@names
def test_toml_keeps_every_text(text, tmp_path):
    name = component_name(text)
    table = RobotTable(
        text or "x",
        (FrameRow(0, name=name),),
        (InertiaRow(1, ZZ=1.0),),
        source=text,
        guess={name: 0.5},
    )
    write_toml(table, tmp_path / "arm.toml")
    data = tomllib.loads((tmp_path / "arm.toml").read_bytes().decode("utf-8"))
    assert data["source"] == text
    assert data["guess"] == {name: 0.5}
    assert "parameters" not in data


def test_keys_of_toml_beyond_the_first_plane(tmp_path):
    table = RobotTable(
        "arm",
        (FrameRow(0, name="\U0001f916"),),
        (InertiaRow(1, ZZ=1.0),),
        guess={"\U0001f916": 0.5},
    )
    write_toml(table, tmp_path / "arm.toml")
    assert mbs.formats.read_toml(tmp_path / "arm.toml") == table


# ---- names of a Function's own inputs and outputs ----


def strange(name):
    x = SX.sym("x", 2)
    return Function("f", [x], [casadi.sin(x)], [f"x{name}"], [f"y{name}"])


@pytest.mark.sweep
@names
@pytest.mark.parametrize("language", TEXTS)
def test_arguments_are_identifiers(language, text):
    source = mbs.export.code(strange(text), language)
    code = re.sub(r"\(\*.*?\*\)", "", source, flags=re.DOTALL)
    assert not [
        s for s in code.splitlines() if EVIL in s and not re.search(rf"\w*{EVIL}\w*|[#%!]|//", s)
    ]
    assert source.isascii()


@pytest.mark.parametrize("name", [" b", "\u00e9", "-b", ""])
def test_parameters_of_a_c_library_are_identifiers(name, tmp_path):
    folder = mbs.export.c_library(strange(name), tmp_path / "lib")
    flags = ["-std=c99", "-Wall", "-Werror", "-c", "-Wno-unused-parameter"]
    command = [*find_compiler().command, *flags, "lib.c", "example.c"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)


@pytest.mark.parametrize("name", ["a*/b", 'a"b', "a\\", "a\nb", "a??/"])
def test_names_that_casadi_would_write_as_they_are(name, tmp_path):
    with pytest.raises(ModelError, match=r"f: the name .* cannot be written as C; call inputs"):
        mbs.export.c_library(strange(name), tmp_path / "lib")
    with pytest.raises(ModelError, match=r"f: the name .* cannot be written as C; call inputs"):
        mbs.native.compiled(strange(name))
    assert not (tmp_path / "lib").exists()
