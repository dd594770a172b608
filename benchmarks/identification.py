"""Numbers of base parameters of the robots of the catalogue, and how long they take.

python benchmarks/identification.py panda sr400

For every robot: inertial parameters, then with rotors, then with friction too, as the rules and the
rank of the regressor give them; CPU time of the symbolic method with its check, for all parameters
of a newly assembled robot; operations of inverse dynamics, full and in base parameters.
"""

from __future__ import annotations

import argparse
import time

import mbs
from mbs.assembly import System
from mbs.identification import base_parameters, columns_of
from mbs.identification.regressors import ColumnChoice
from mbs.operations import count

ROBOTS = (
    *("puma560", "rx90", "stanford", "scara", "panda", "two_branch_tree"),
    *("sr400", "akr3000", "four_bar", "five_bar", "delta", "differential_wrist", "bricard"),
)
CHOICES: tuple[ColumnChoice, ...] = (
    {"rotors": False, "friction": False},
    {"friction": False},
    {},
)


def main() -> None:
    """Print a line for every robot that is named, or for a selection."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robots", nargs="*", default=ROBOTS)
    for name in parser.parse_args().robots:
        print(_line(name), flush=True)


def _line(name: str) -> str:
    system = mbs.load(name).assemble()
    begin = time.process_time()
    base = base_parameters(system)
    seconds = time.process_time() - begin
    found = [base_parameters(system, columns=columns_of(system, **only)) for only in CHOICES]
    counts = " | ".join(f"{each.count} ({each.check.rank})" for each in found)
    missed = len(base.check.relations)
    return (
        f"{name}: {counts}; {seconds:.2f} s; relations by rank alone {missed};"
        f" inverse dynamics {_operations(system)} -> {_operations(base.apply())}"
    )


def _operations(system: System) -> str:
    found = count(mbs.models.inverse_dynamics(system))
    return f"{found.mul + found.div}/{found.add}"


if __name__ == "__main__":
    main()
