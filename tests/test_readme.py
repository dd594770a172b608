"""Every Python block of the README and of docs/ runs, in order, in an empty folder."""

import re
from pathlib import Path

import pytest
from PIL import Image

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
_BLOCK = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"\]\((?!http|#)([^)#]+)")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_python_blocks_run(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = page.read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in _BLOCK.finditer(text):
        line = text.count("\n", 0, block.start(1))
        exec(compile("\n" * line + block[1], str(page), "exec"), names)
    printed = capsys.readouterr().out
    if page.name in ("README.md", "getting_started.md"):
        quoted = re.search(r"The report says what was found:\n\n(.*?)\n\n", text, re.DOTALL)
        assert quoted is not None
        assert "\n".join(row[4:] for row in quoted[1].splitlines()) in printed
    if page.name == "README.md":
        assert "6.70913" in printed
        drawn, kept = tmp_path / "four_bar.gif", ROOT / "docs" / "images" / "four_bar.gif"
        assert _size_and_pictures(drawn) == _size_and_pictures(kept)
    if page.name == "getting_started.md":
        for number in ("6.70913 5", "-3.924", "-19.62", "['m', 'L']"):
            assert number in printed.replace("DM(", ""), number
        assert (tmp_path / "motion.png").stat().st_size > 1000
        assert float(abs(names["result"]["j4.q"] - names["other"]["j4.q"]).max()) < 1e-6


def _size_and_pictures(film: Path) -> tuple[int, int, int]:
    """Width, height and number of pictures of a GIF."""
    with Image.open(film) as image:
        return (*image.size, image.n_frames)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_between_pages_lead_to_files(page: Path) -> None:
    for target in _LINK.findall(page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), target


@pytest.mark.parametrize(("name", "most"), [("four_bar.png", 100_000), ("four_bar.gif", 400_000)])
def test_picture_is_small_enough_to_keep(name: str, most: int) -> None:
    assert 10_000 < (ROOT / "docs" / "images" / name).stat().st_size < most


def test_measured_figures_of_the_readme_stand_on_the_pages_it_names() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    number = re.compile(r"(?<![\w.])\d[\d,.]*(?:e-\d+)?(?<![,.])")
    rows = re.findall(
        r"^\| [^|]+ \| ([^|]*\d[^|]*) \| \[[^|]*\]\((docs/\w+\.md)[^|]*\|$", text, re.MULTILINE
    )
    assert len(rows) == 11
    for measured, page in rows:
        known = set(number.findall((ROOT / page).read_text(encoding="utf-8")))
        assert set(number.findall(measured.replace("PUMA 560", "PUMA"))) - known == set(), page


def test_readme_has_two_screens() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 95
