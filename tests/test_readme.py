"""Every Python block of the README and of docs/ runs, in order, in an empty folder."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image
from support.page import PROGRAM, absent, blocks, documented_extras
from support.sweeps import slow

from mbs.core.build import COMPILERS

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
_LINK = re.compile(r"\]\((?!http|#)([^)#]+)")


WITH_CODE = [page for page in PAGES if blocks(page)]
AFTERWARDS = {
    "getting_started.md": "assert abs(result['j4.q'] - other['j4.q']).max() < 1e-6",
}
"""Code that runs after a page, with the names of the page."""
COMPILER = () if any(map(shutil.which, COMPILERS)) or os.environ.get("CC") else ("cross",)
"""The extra with a C compiler, which an installation needs on a computer without one."""


SLOW = ("closed_forms.md", "export.md")
"""Pages whose code takes longest; guides and other pages call the same functions."""


@pytest.mark.parametrize(
    "page",
    [slow(page) if page.name in SLOW else page for page in WITH_CODE],
    ids=lambda page: page.name,
)
def test_python_blocks_run_in_the_installation_that_is_documented(
    page: Path, tmp_path: Path
) -> None:
    hidden = ",".join(absent((*documented_extras(page), *COMPILER)))
    command = [sys.executable, str(PROGRAM), str(page), hidden, AFTERWARDS.get(page.name, "")]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    printed, text = ran.stdout, page.read_text(encoding="utf-8")
    if page.name in ("README.md", "getting_started.md"):
        introduction = "The report lists the structure and the mobility:\n\n"
        quoted = re.search(rf"{introduction}(.*?)\n\n", text, re.DOTALL)
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


def test_what_an_installation_without_extras_lacks(tmp_path: Path) -> None:
    """The test above can fail: a page that plots needs matplotlib, and is refused without."""
    page = tmp_path / "page.md"
    page.write_text("```python\nimport mbs\nimport matplotlib\n```\n", encoding="utf-8")
    command = [sys.executable, str(PROGRAM), str(page)]
    ran = subprocess.run([*command, ",".join(absent(()))], capture_output=True, text=True)
    assert "No module named 'matplotlib'" in ran.stderr
    assert subprocess.run([*command, ",".join(absent(("plot",)))]).returncode == 0


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
    assert len(rows) == 17
    for measured, page in rows:
        known = set(number.findall((ROOT / page).read_text(encoding="utf-8")))
        assert set(number.findall(measured.replace("PUMA 560", "PUMA"))) - known == set(), page


def test_readme_has_two_screens() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 95
