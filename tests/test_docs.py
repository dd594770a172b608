"""The pages of docs/ name every component, model and source that there is."""

import importlib.metadata
import re
from pathlib import Path

import pytest

import mbs

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
_SOURCE = re.compile(r"Source:(.*?)(?:\n\s*\n|\"\"\"|\*/)", re.DOTALL)
_AUTHOR_YEAR = re.compile(
    r"\b([A-Z][a-z]+(?:-[A-Z][a-z]+)?)(?:(?:,| &| and) (?:and )?(?:Van )?[A-Z][a-z]+)*,?"
    r" ((?:19|20)\d\d)\b"
)
_ENTRY = re.compile(r"@\w+\{(\w+),\s*author = \{([^,]+),.*?year = \{(\d+)\}", re.DOTALL)


def _plain(name: str) -> str:
    return name.replace(r"{\o}", "o")


def test_every_source_in_the_code_is_in_the_bibliography() -> None:
    text = (DOCS / "references.bib").read_text(encoding="utf-8")
    entries = _ENTRY.findall(text)
    known = {(_plain(author), year) for _, author, year in entries}
    assert len({key for key, _, _ in entries}) == text.count("\n@") + 1
    cited: dict[tuple[str, str], str] = {}
    for path in (ROOT / "mbs").rglob("*.[pch]*"):
        if path.suffix in (".py", ".c", ".h"):
            for source in _SOURCE.findall(path.read_text(encoding="utf-8")):
                flat = " ".join(source.replace("*", " ").replace("#", " ").split())
                cited.update({pair: path.name for pair in _AUTHOR_YEAR.findall(flat)})
    assert len(cited) > 10
    assert {pair: where for pair, where in cited.items() if pair not in known} == {}


@pytest.mark.parametrize(
    ("page", "module", "left_out"),
    [
        (
            "components.md",
            "components",
            {"Component", "Description", "ImportNote", "Joint", "Point", "SubMechanism"},
        ),
        ("models.md", "models", set()),
        ("export.md", "export", set()),
    ],
)
def test_page_names_everything(page: str, module: str, left_out: set[str]) -> None:
    text = (DOCS / page).read_text(encoding="utf-8")
    names = set(getattr(mbs, module).__all__) - left_out - {"RigidBody"}
    assert {name for name in names if not re.search(rf"`[\w.]*\b{name}\b", text)} == set()


def test_index_links_to_every_page() -> None:
    text = (DOCS / "index.md").read_text(encoding="utf-8")
    pages = {page.name for page in DOCS.glob("*.md")} - {"index.md"}
    assert {page for page in pages if f"]({page})" not in text} == set()


def test_version_stands_in_one_file() -> None:
    assert f"## {mbs.__version__}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert importlib.metadata.version("casadi-mbs") == mbs.__version__
    for file in ("CITATION.cff", "pyproject.toml"):
        text = (ROOT / file).read_text(encoding="utf-8")
        assert not re.search(r"^version", text, re.MULTILINE), file


def test_comparison_quotes_what_the_measured_pages_say() -> None:
    measured = {
        row
        for page in ("operations", "speed", "inverse_geometry", "derivatives")
        for row in (DOCS / f"{page}.md").read_text(encoding="utf-8").splitlines()
    }
    text = (DOCS / "comparison.md").read_text(encoding="utf-8").split("## Agreement")[0]
    quoted = [row for row in text.splitlines() if re.match(r"\| .*\d", row)]
    assert len(quoted) > 15
    assert [row for row in quoted if row not in measured] == []


@pytest.mark.parametrize("robot", ["planar_2r", "four_bar"])
def test_notation_names_inputs_and_outputs_of_models(robot: str) -> None:
    text = (DOCS / "notation.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"`(\w+)`", text))
    system = mbs.load(robot).assemble()
    used: set[str] = set()
    for entry in mbs.models.catalogue.entries():
        if not entry.key.startswith("igm") and entry.applies(system) and entry.has_function(system):
            function = entry.build(system)
            used.update(function.name_in(), function.name_out())
    assert len(used) > 20
    assert {name.replace("_a_", "_").removesuffix("_a") for name in used} - listed == set()


def test_every_work_that_a_page_names_is_in_the_bibliography() -> None:
    text = (DOCS / "references.bib").read_text(encoding="utf-8")
    known = {(_plain(author), year) for _, author, year in _ENTRY.findall(text)}
    known |= {
        (_plain(author.split(",")[0]), year)
        for people, year in re.findall(r"author = \{(.+?)\},\n.*?year = \{(\d+)\}", text, re.DOTALL)
        for author in people.split(" and ")
    }
    unknown = {}
    for page in DOCS.glob("*.md"):
        flat = " ".join(page.read_text(encoding="utf-8").split())
        found = re.findall(r"\b([A-Z][a-z]+)(?: et al\.)? ((?:19|20)\d\d)\b", flat)
        unknown.update({pair: page.name for pair in found if pair not in known})
    assert unknown == {}


def test_every_public_package_has_a_page_in_the_reference() -> None:
    pages = [path.read_text(encoding="utf-8") for path in (DOCS / "api").glob("*.md")]
    shown = {name for page in pages for name in re.findall(r"automodule:: (\S+)", page)}
    packages = {f"mbs.{name}" for name in mbs.__all__ if name.islower() and name != "load"}
    assert packages - shown == set()
