"""One name has one meaning in the whole package."""

import ast
from collections import defaultdict
from pathlib import Path

import mbs

ROOT = Path(mbs.__file__).parent


def test_a_class_has_a_name_of_its_own():
    places = defaultdict(list)
    for file in sorted(ROOT.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(f"{file.relative_to(ROOT)}:{node.lineno}")
    assert len(places) > 500
    twice = {name: where for name, where in places.items() if len(where) > 1}
    assert not twice
