"""The recipes of docs/contributing.md, followed in a copy of the package."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "docs" / "contributing.md").read_text(encoding="utf-8")
_BLOCK = re.compile(r"^```(py|diff)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def recipes() -> dict[str, list[tuple[str, str, str]]]:
    """Heading -> blocks: "py" or "diff", first line, the rest."""
    found = {}
    for part in TEXT.split("\n## ")[1:]:
        heading, text = part.split("\n", 1)
        blocks = [(kind, *body.split("\n", 1)) for kind, body in _BLOCK.findall(text)]
        if blocks:
            found[heading] = blocks
    return found


def edited(text: str, hunk: str) -> str:
    """A file with the lines of a hunk added and removed, at the one place where it fits."""
    lines = hunk.splitlines(keepends=True)
    before = "".join(line[1:] for line in lines if line[:1] in " -")
    after = "".join(line[1:] for line in lines if line[:1] in " +")
    assert all(line[:1] in "+- " for line in lines)
    assert text.count(before) == 1, before
    return text.replace(before, after)


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """A copy of mbs with every file and edit of the recipes, and the checks."""
    folder = tmp_path_factory.mktemp("copy")
    shutil.copytree(ROOT / "mbs", folder / "mbs", ignore=shutil.ignore_patterns("__pycache__"))
    checks = []
    for blocks in recipes().values():
        for kind, first, rest in blocks:
            if kind == "diff":
                path = folder / first
                text = path.read_text(encoding="utf-8")
                for hunk in rest.split("@@\n"):
                    text = edited(text, hunk)
                path.write_text(text, encoding="utf-8")
            elif first == "# check":
                checks.append(rest)
            else:
                path = folder / first.removeprefix("# ")
                assert not path.exists()
                path.write_text(rest, encoding="utf-8")
    return folder, checks


def test_there_is_a_recipe_with_a_check_for_each() -> None:
    found = recipes()
    assert list(found) == ["A joint", "A model", "A language", "A robot"]
    for heading, blocks in found.items():
        assert [first for _, first, _ in blocks].count("# check") == 1, heading


def test_recipes_work(package: tuple[Path, list[str]]) -> None:
    folder, checks = package
    script = "import mbs, pathlib\n" + "\n".join(checks)
    script += "\nprint(pathlib.Path(mbs.__file__).parents[1], 'recipes', len(mbs.__all__) > 0)"
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    command = [sys.executable, "-W", "error", "-c", script]
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [str(folder), "recipes", "True"]
