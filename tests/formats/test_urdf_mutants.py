"""Mutants of a URDF file: each is read, with notes or without, or refused in one sentence.

By hand, for more of them: PYTHONPATH=tests python tests/formats/test_urdf_mutants.py 5000
"""

import random

import pytest
from support.xml_mutants import encoded, mutated, outcome, search_by_hand, torn

INERTIAL = """<inertial><origin xyz=".1 .2 .3" rpy=".1 0 .3"/><mass value="2"/>
<inertia ixx=".3" iyy=".4" izz=".35" ixy=".01" ixz=".02" iyz=".03"/></inertial>"""
ARM = f"""<?xml version="1.0" encoding="UTF-8"?>
<robot name="arm">
  <!-- of three joints -->
  <link name="base"/>
  <link name="upper arm">{INERTIAL}</link>
  <link name="fore.arm">{INERTIAL}<visual><geometry><box size="1 1 1"/></geometry></visual></link>
  <link name="finger">{INERTIAL}</link>
  <link name="tool"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper arm"/>
    <origin xyz="0 0 1" rpy="0 .1 .2"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" effort="1" velocity="1"/><dynamics damping=".5" friction=".2"/>
  </joint>
  <joint name="elbow" type="continuous"><parent link="upper arm"/><child link="fore.arm"/>
    <origin xyz=".2 0 0"/><axis xyz="0 .6 .8"/></joint>
  <joint name="finger" type="prismatic"><parent link="fore.arm"/><child link="finger"/>
    <limit upper="0.1" effort="1" velocity="1"/><mimic joint="elbow" multiplier="2" offset=".1"/>
  </joint>
  <joint name="flange" type="fixed"><parent link="fore.arm"/><child link="tool"/></joint>
  <transmission name="t"><joint name="shoulder"/><actuator name="m">
    <mechanicalReduction>50</mechanicalReduction><motorInertia>1e-4</motorInertia></actuator>
  </transmission>
  <gazebo reference="elbow"><mu1>1</mu1></gazebo>
</robot>
"""


def mutant(rng):
    """The file with changes of attributes, elements, letters and bytes, or torn."""
    text = mutated(rng, ARM) if rng.random() < 0.85 else ARM
    for _ in range(rng.choice((0, 0, 0, 1, 2))):
        text = torn(rng, text)
    return encoded(rng, text)


@pytest.mark.parametrize("seed", range(6))
def test_a_sentence_or_notes(tmp_path, seed):
    rng = random.Random(seed)
    outcomes = [outcome(mutant(rng), tmp_path / "arm.urdf", rng) for _ in range(50)]
    assert {"read", "refused"} == set(outcomes)


if __name__ == "__main__":
    search_by_hand(mutant, "arm.urdf")
