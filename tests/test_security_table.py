"""The page on security: every row names tests, and they exist."""

import ast
import re
from pathlib import Path

TESTS = Path(__file__).parent
PAGE = TESTS.parent / "docs" / "security.md"
_NAMED = re.compile(r"`(?:([\w/]+\.py))?::(\w+)`")


def test_every_row_is_tried_by_tests_that_exist() -> None:
    rows = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    assert len(rows) > 18
    for row in rows[1:]:
        named = _NAMED.findall(row.rsplit("|", 2)[1])
        assert named, row
        file = ""
        for place, test in named:
            file = place or file
            tree = ast.parse((TESTS / file).read_text(encoding="utf-8"))
            names = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
            assert test in names, f"{file}::{test}"
