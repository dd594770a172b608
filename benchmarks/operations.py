"""Operations of the models beside those of other tools, as the table of docs/operations.md.

python benchmarks/operations.py docs/operations.md
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import mbs
from mbs.assembly import System
from mbs.files import write_text
from mbs.operations import count, simplify

sys.path.insert(0, str(Path(__file__).parent))
from symbolic_robots import ROBOTS, symbolic_robot

Builder = Callable[[System], "mbs.Function"]

MODELS: dict[str, Callable[[System], object]] = {
    "IDM": mbs.models.inverse_dynamics,
    "A": mbs.models.inertia_matrix,
    "H": mbs.models.bias,
    "DDM": mbs.models.direct_dynamics,
    "DGM": lambda system: mbs.models.transform(system, len(system.links)),
    "J": lambda system: mbs.models.jacobian(system, len(system.links)),
}
"""Column of the table and the model that it counts."""

OTHERS = {
    ("general 6R", "IDM"): "470/376",
    ("general 6R", "A"): "590/438",
    ("general 6R", "H"): "458/358",
    ("general 6R", "DDM"): "1701/1342",
    ("PUMA 560", "IDM"): "314/253",
    ("PUMA 560", "A"): "226/177",
    ("PUMA 560", "H"): "298/227",
    ("PUMA 560", "DDM"): "960/738",
    ("PUMA 560", "DGM"): "62/32",
    ("PUMA 560", "J"): "52/25",
    ("RX90", "IDM"): "286/226",
    ("RX90", "A"): "167/131",
    ("RX90", "H"): "276/207",
    ("RX90", "DDM"): "808/607",
    ("RX90", "DGM"): "55/25",
    ("RX90", "J"): "34/11",
    ("iiwa", "IDM"): "343/271",
    ("iiwa", "A"): "229/179",
    ("iiwa", "H"): "335/256",
    ("iiwa", "DDM"): "968/731",
    ("iiwa", "DGM"): "68/31",
    ("iiwa", "J"): "73/29",
    ("Stanford", "IDM"): "260/211",
    ("Stanford", "A"): "127/103",
    ("Stanford", "H"): "248/189",
    ("Stanford", "DDM"): "685/519",
    ("Stanford", "DGM"): "43/18",
    ("Stanford", "J"): "29/9",
    ("SR400 tree", "IDM"): "410/323",
    ("SR400 tree", "A"): "227/180",
    ("SR400 tree", "H"): "388/283",
    ("SR400 tree", "DDM"): "1113/845",
}
"""The fewest that OpenSYMORO (2015) or SymPyBotics (2014) give in base parameters, after their
unused lines, lines of constants alone and repeated sub-expressions were removed."""

_HEAD = """# Operations of the models

Made by `python benchmarks/operations.py docs/operations.md`. Multiplications / additions of each
model as it is built, then after `mbs.operations.simplify`, then the fewest of OpenSYMORO and
SymPyBotics for the same robot in base parameters.

The convention is that of Khalil & Kleinfinger 1987: lengths and inertial parameters are symbols,
what depends on them alone is computed once and not counted, a division counts as a multiplication,
a square too; signs, sines and cosines are not counted; no friction, no rotors, no external
wrench. Full and base inertial parameters give the same counts, because the models regroup the
parameters themselves; the table was made with the full ones. The other tools' figures were counted
in the same way on the text that they write, with unused lines, lines of constants and repeated
sub-expressions removed first. For the general 6R robot Khalil & Kleinfinger's formula (92 n - 127,
81 n - 117) gives 425/369 for the IDM.
"""


def main() -> None:
    """Write the table to the file that is named, or print it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", nargs="?", type=Path)
    output = parser.parse_args().output
    text = table()
    if output is None:
        print(text)
    else:
        write_text(output, text)


def table() -> str:
    """The page, in Markdown."""
    lines = [_HEAD, "| robot | " + " | ".join(MODELS) + " |", "|---" * (len(MODELS) + 1) + "|"]
    begin = time.process_time()
    for name in ROBOTS:
        system = symbolic_robot(name, base=False).assemble()
        lines.append(f"| {name} | " + " | ".join(_cell(name, m, system) for m in MODELS) + " |")
    print(f"{time.process_time() - begin:.1f} s", file=sys.stderr)
    lines += ["", "A cell reads: as built, *simplified*, (others)."]
    return "\n".join(lines) + "\n"


def _cell(robot: str, model: str, system: System) -> str:
    function = MODELS[model](system)
    other = OTHERS.get((robot, model))
    counts = f"{count(function)}, *{count(simplify(function))}*"
    return counts if other is None else f"{counts}, ({other})"


if __name__ == "__main__":
    main()
