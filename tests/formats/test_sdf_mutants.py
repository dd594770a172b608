"""Mutants of an SDFormat file: each is read, with notes or without, or refused in one sentence.

By hand, for more of them: PYTHONPATH=tests python tests/formats/test_sdf_mutants.py 5000
"""

import random

import pytest
from support.xml_mutants import mutated, outcome, search_by_hand

INERTIAL = """<inertial><pose>.1 .2 .3 .1 0 .3</pose><mass>2</mass><inertia><ixx>.3</ixx>
<iyy>.4</iyy><izz>.35</izz><ixy>.01</ixy></inertia></inertial>"""
FILE = f"""<?xml version="1.0"?>
<sdf version="1.9"><world name="w"><gravity>0 0 -9.8</gravity><frame name="f"/>
<model name="m" canonical_link="a" placement_frame="t"><pose relative_to="f">0 0 1 0 0 0</pose>
<link name="a">{INERTIAL}</link>
<link name="b"><pose relative_to="j">1 0 0 0 0 .3</pose>{INERTIAL}<gravity>false</gravity></link>
<link name="c"><pose degrees="true">1 1 0 0 0 30</pose>{INERTIAL}<visual name="v"/></link>
<joint name="j" type="revolute"><pose relative_to="a">0 0 .1 0 0 0</pose><parent>a</parent>
<child>b</child><axis><xyz expressed_in="__model__">0 1 0</xyz><limit><lower>-1</lower>
<upper>2</upper><effort>3</effort></limit><dynamics><damping>.1</damping></dynamics></axis></joint>
<joint name="k" type="universal"><parent>b</parent><child>c</child><axis><xyz>1 0 0</xyz></axis>
<axis2><xyz>0 1 0</xyz></axis2></joint>
<joint name="l" type="ball"><parent>world</parent><child>c</child></joint>
<joint name="g" type="gearbox"><parent>a</parent><child>b</child>
<gearbox_ratio>2</gearbox_ratio><gearbox_reference_body>a</gearbox_reference_body></joint>
<frame name="t" attached_to="n::d"><pose rotation_format="quat_xyzw">1 0 0 0 0 0 1</pose></frame>
<model name="n"><pose relative_to="b">0 0 0 0 0 0</pose><link name="d">{INERTIAL}</link></model>
<joint name="s" type="screw"><parent>b</parent><child>n::d</child>
<screw_thread_pitch>.2</screw_thread_pitch><axis><xyz>0 0 1</xyz><mimic joint="j">
<multiplier>2</multiplier></mimic></axis></joint>
</model></world></sdf>
"""
TEXTS = ("", "x", "nan", "inf", "-1", "0", "1e308", "1 2", "world", "a", "b", "j", "n::d", "true")
KINDS = ("fixed", "revolute2", "prismatic", "gearbox", "continuous", "screw", "universal", "ball")
ASSEMBLED = 0.3
"""Of the mutants that are read: assembling their loops takes most of the time."""


def mutant(rng):
    """The file with changes of attributes, elements, letters and texts of elements, as bytes."""
    text = FILE
    if rng.random() < 0.85:
        text = text[: text.index('<joint name="g"')] + text[text.index('<frame name="t"') :]
    for _ in range(rng.choice((0, 0, 0, 1))):
        ends = [k for k in range(len(text) - 1) if text[k] == ">" and text[k + 1] not in "<\n"]
        at = rng.choice(ends) + 1
        text = text[:at] + rng.choice(TEXTS) + text[max(text.find("<", at), at) :]
    if rng.random() < 0.2:
        text = text.replace(rng.choice(KINDS), rng.choice(KINDS), 1)
    return (mutated(rng, text) if rng.random() < 0.7 else text).encode()


@pytest.mark.parametrize("seed", range(6))
def test_a_sentence_or_notes(tmp_path, seed):
    rng = random.Random(seed)
    outcomes = [outcome(mutant(rng), tmp_path / "m.sdf", rng, ASSEMBLED) for _ in range(50)]
    assert {"read", "refused"} == set(outcomes)


if __name__ == "__main__":
    search_by_hand(mutant, "m.sdf", ASSEMBLED)
