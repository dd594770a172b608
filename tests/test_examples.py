"""Every example runs to its end and finds what it should."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from support.sweeps import slow

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))
_NUMBER = r"(-?\d[\d.]*(?:e[-+]\d+)?)"

SMALL = {
    "01_four_bar": {
        "idm(ddm(tau)) - tau": 1e-12,
        "A a + B v + Q - tau": 1e-12,
        "v' A v / 2 - E": 1e-12,
        "largest closure residual": 1e-9,
        "energy gained - work done": 1e-7,
        "CoSimulation: largest difference of positions and velocities": 1e-7,
        "ModelExchange: largest difference of positions and velocities": 1e-6,
    },
    "02_puma560": {
        "idm(ddm(tau)) - tau": 1e-11,
        "A a + B v + Q - tau": 1e-11,
        "bias(q, 0) - gravity(q)": 1e-12,
        "J v - d(dgm)/dt": 1e-8,
        "change of energy": 1e-7,
        "CoSimulation: largest difference of positions and velocities": 1e-7,
        "ModelExchange: largest difference of positions and velocities": 1e-6,
    },
    "03_inverse_geometry": {
        "Largest pose(q) - T": 1e-12,
        "Nearest solution - q": 1e-10,
        "Function igm(T, branch) - q": 1e-9,
        "Largest residual on the line": 1e-12,
    },
    "04_identification": {
        "Largest error of a parameter": 0.05,
        "Residual on the same motion": 0.6,
        "Residual on the other motion": 0.6,
    },
    "05_co_simulation": {
        "FMI 2.0 CoSimulation: largest difference of the angle": 1e-8,
        "FMI 2.0 ModelExchange: largest difference of the angle": 1e-6,
        "FMI 3.0 ModelExchange: largest difference of the angle": 1e-6,
        "Time at which the hatch lifts - expected": 1e-8,
        "Steps of 0.5 ms: difference": 3e-3,
        "Half the step, ratio - 2": 0.05,
    },
    "06_acrobot": {
        "Least integral of the torque squared - 53.527": 1e-3,
        "Compiled - interpreted": 1e-6,
    },
    "07_panda": {
        "Least effort, change with twice the stages": 1e-3,
        "Least time, change with twice the stages": 5e-3,
    },
    "08_four_bar_motion": {
        "reduced: least integral of the torque squared - 28.1827": 2e-4,
        "index2: least integral of the torque squared - 28.1827": 2e-4,
        "ggl: least integral of the torque squared - 28.1827": 2e-4,
        "Largest difference of positions between reduced and ggl": 1e-3,
    },
    "09_sr400_pick_and_place": {
        "Simulated with these torques, largest error of a motor": 5e-3,
        "Largest gap of the loop": 1e-12,
    },
    "10_quadruped_jump": {
        "Feet in stance move by": 5e-3,
        "Largest slope of a force or impulse": 0.6 + 1e-6,
        "Flight, simulated with these torques": 5e-3,
    },
    "11_chain": {
        "1 link: shooting - collocation": 1e-3,
        "2 links: shooting - collocation": 1e-3,
        "4 links: shooting - collocation": 1e-2,
    },
    "12_bare_c": {
        "Status": 0.5,
        "Difference from continuous control": 5e-3,
    },
    "13_quadruped_drop": {
        "Normal forces at the end / weight - cos(slope)": 1e-3,
        "Largest friction / normal force": 0.6 + 1e-9,
        "Fastest slip of a foot at the end": 1e-6,
        "Trunk moves in the last second by": 1e-3,
        "Energy that is gained": 1e-4,
    },
}
"""What each example prints, and how large it may be."""

FILES = {
    "01_four_bar": ["four_bar.png", "four_bar.fmu", "motion.csv", "models/models.c", "example"],
    "02_puma560": ["puma560.png", "puma560.fmu", "fall.csv", "models/models.h"],
    "03_inverse_geometry": ["configurations.png", "igm.c", "equations.txt"],
    "04_identification": ["identification.png", "motion.csv"],
    "05_co_simulation": ["co_simulation.png", "hatch3.fmu", "cell.ssp", "study/case_000014.npz"],
    "06_acrobot": ["acrobot.png"],
    "07_panda": ["panda.png"],
    "08_four_bar_motion": ["four_bar_motion.png"],
    "09_sr400_pick_and_place": ["sr400.png"],
    "10_quadruped_jump": ["quadruped.png"],
    "11_chain": ["chain.png"],
    "12_bare_c": ["crank/crank.h", "crank/four_bar_step.c"],
    "13_quadruped_drop": ["quadruped_drop.png"],
}


SLOW = ("04_identification", "05_co_simulation", "07_panda", "10_quadruped_jump", "11_chain")
"""Examples that take longest; what they show has tests of its own, and the others run always."""


@pytest.mark.parametrize(
    "path",
    [slow(path) if path.stem in SLOW else path for path in EXAMPLES],
    ids=lambda path: path.stem,
)
def test_example_runs_and_finds(path: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    answer = subprocess.run(
        [sys.executable, "-W", "error", str(path), str(folder)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONUTF8": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert answer.returncode == 0, answer.stderr
    for label, limit in SMALL[path.stem].items():
        found = re.search(rf"{re.escape(label)}:? {_NUMBER}", answer.stdout)
        assert found is not None, label
        assert abs(float(found[1])) < limit, label
    for name in FILES[path.stem]:
        assert (folder / name).stat().st_size > 1000, name
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
    if path.stem == "01_four_bar":
        require_what_the_loop_is(answer.stdout)


def require_what_the_loop_is(text: str) -> None:
    """In what the example of the four-bar says."""
    assert "2 of 5 rows are independent" in text
    assert "acceleration of j1: 6.709128 rad/s2" in text
    printed = {
        line.split()[1]: float(line.split()[2])
        for line in text.splitlines()
        if re.match(r" +(idm|ddm|lagrange) \w+ ", line) and len(line.split()) == 3
    }
    assert set(printed) == {"tau_a", "a_a", "A_a", "B_a", "Q_a"}
