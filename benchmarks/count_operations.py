"""Operations of the models beside those of other tools, as the table of docs/operations.md.

python benchmarks/count_operations.py docs/operations.md
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

from casadi import Function

import mbs
from mbs.assembly import System
from mbs.files import write_text
from mbs.identification import energy_regressor, filtered_regressor, regressor
from mbs.operations import count, simplify

sys.path.insert(0, str(Path(__file__).parent))
from symbolic_robots import ROBOTS, symbolic_robot

MODELS: dict[str, Callable[[System], Function]] = {
    "IDM": mbs.models.inverse_dynamics,
    "A": mbs.models.inertia_matrix,
    "H": mbs.models.bias,
    "DDM": mbs.models.direct_dynamics,
    "DGM": lambda system: mbs.models.transform(system, len(system.links)),
    "J": lambda system: mbs.models.jacobian(system, len(system.links)),
}
"""Column of the table and the model that it counts."""

COLUMNS: dict[str, Callable[[System], Function]] = {
    "D": lambda system: regressor(system, rotors=False, friction=False),
    "D1, D2": lambda system: filtered_regressor(system, rotors=False, friction=False),
    "h": lambda system: energy_regressor(system, rotors=False, friction=False),
}
"""The same for the identification models, of full parameters."""

TITLES = {
    "general_6r": "general 6R",
    "puma560": "PUMA 560",
    "rx90": "RX90",
    "iiwa": "iiwa",
    "stanford": "Stanford",
    "sr400_tree": "SR400 tree",
}
"""Names in the table."""

OTHERS = {
    ("general_6r", "IDM"): "470/376",
    ("general_6r", "A"): "590/438",
    ("general_6r", "H"): "458/358",
    ("general_6r", "DDM"): "1701/1342",
    ("puma560", "IDM"): "314/253",
    ("puma560", "A"): "226/177",
    ("puma560", "H"): "298/227",
    ("puma560", "DDM"): "960/738",
    ("puma560", "DGM"): "62/32",
    ("puma560", "J"): "52/25",
    ("puma560", "D"): "836/566",
    ("rx90", "IDM"): "286/226",
    ("rx90", "A"): "167/131",
    ("rx90", "H"): "276/207",
    ("rx90", "DDM"): "808/607",
    ("rx90", "DGM"): "55/25",
    ("rx90", "J"): "34/11",
    ("rx90", "D"): "670/439",
    ("iiwa", "IDM"): "343/271",
    ("iiwa", "A"): "229/179",
    ("iiwa", "H"): "335/256",
    ("iiwa", "DDM"): "968/731",
    ("iiwa", "DGM"): "68/31",
    ("iiwa", "J"): "73/29",
    ("iiwa", "D"): "966/607",
    ("stanford", "IDM"): "260/211",
    ("stanford", "A"): "127/103",
    ("stanford", "H"): "248/189",
    ("stanford", "DDM"): "685/519",
    ("stanford", "DGM"): "43/18",
    ("stanford", "J"): "29/9",
    ("sr400_tree", "IDM"): "410/323",
    ("sr400_tree", "A"): "227/180",
    ("sr400_tree", "H"): "388/283",
    ("sr400_tree", "DDM"): "1113/845",
}
"""The fewest that OpenSYMORO (2015) or SymPyBotics (2014) give in base parameters, after their
unused lines, lines of constants alone and repeated sub-expressions were removed."""

_HEAD = """# Operations of the models

The table is made by `python benchmarks/count_operations.py docs/operations.md`. It gives
multiplications / additions of each model as it is built, then after `mbs.operations.simplify`,
then the fewest of OpenSYMORO and SymPyBotics for the same robot in base parameters.

The counting convention is that of Khalil & Kleinfinger 1987:

- Lengths and inertial parameters are symbols. Operations on these symbols alone are done once
  and not counted.
- A division counts as a multiplication, and so does a square. Signs, sines and cosines are not
  counted.
- The models have no friction, no rotors and no external wrench.

Full and base inertial parameters give the same counts, because the models regroup the
parameters themselves. The table was made with full parameters. Operations of the other tools
were counted in the same way on the code that they generate. Unused lines, lines of constants
and repeated sub-expressions were removed first. For the general 6R robot the formula of Khalil
& Kleinfinger (92 n - 127, 81 n - 117) gives 425/369 for the IDM.

D, D1 and D2, h are the identification models, with a column for each of the ten inertial
parameters of every link. For D the counts of the other tools are for full parameters too.

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
        write_text(text, output)


def table() -> str:
    """The page, in Markdown."""
    models = MODELS | COLUMNS
    lines = [_HEAD, "| robot | " + " | ".join(models) + " |", "|---" * (len(models) + 1) + "|"]
    begin = time.process_time()
    for name in ROBOTS:
        system = symbolic_robot(name).assemble()
        cells = (_cell(name, model, build(system)) for model, build in models.items())
        lines.append(f"| {TITLES[name]} | " + " | ".join(cells) + " |")
    print(f"{time.process_time() - begin:.1f} s", file=sys.stderr)
    lines += ["", "A cell contains: as built, *simplified*, (others)."]
    return "\n".join(lines) + "\n"


def _cell(robot: str, model: str, function: Function) -> str:
    other = OTHERS.get((robot, model))
    counts = f"{count(function)}, *{count(simplify(function))}*"
    return counts if other is None else f"{counts}, ({other})"


if __name__ == "__main__":
    main()
