"""Mutants of an SDFormat file: each is read, with notes or without, or refused in one sentence.

By hand, for more of them: python tests/formats/test_sdf_mutants.py 5000
"""

import random
import sys
import tempfile
from pathlib import Path

import pytest
from support.xml_mutants import mutated

import mbs
from mbs.errors import MbsError

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


def mutant(rng):
    """The file with changes of attributes, elements and letters, and of texts of elements."""
    text = FILE
    if rng.random() < 0.85:
        text = text[: text.index('<joint name="g"')] + text[text.index('<frame name="t"') :]
    for _ in range(rng.choice((0, 0, 0, 1))):
        ends = [k for k in range(len(text) - 1) if text[k] == ">" and text[k + 1] not in "<\n"]
        at = rng.choice(ends) + 1
        text = text[:at] + rng.choice(TEXTS) + text[max(text.find("<", at), at) :]
    if rng.random() < 0.2:
        text = text.replace(rng.choice(KINDS), rng.choice(KINDS), 1)
    return mutated(rng, text) if rng.random() < 0.7 else text


def outcome(text, path, rng):
    """What becomes of a mutant: "read" or "refused"; anything else is raised."""
    path.write_text(text)
    base = rng.choice((None, None, "fixed", "free"))
    try:
        mechanism = mbs.load(path, base=base)
        for note in mechanism.notes:
            assert "\n" not in str(note)
            assert len(str(note)) < 500
        if rng.random() < 0.3 and any(True for _ in mechanism.joints()):
            mechanism.assemble()
    except MbsError as error:
        said = str(error)
        assert "\n" not in said, said
        assert len(said.replace(str(path), "")) < 1200, said
        return "refused"
    return "read"


@pytest.mark.parametrize("seed", range(6))
def test_a_sentence_or_notes(tmp_path, seed):
    rng = random.Random(seed)
    outcomes = [outcome(mutant(rng), tmp_path / "m.sdf", rng) for _ in range(50)]
    assert {"read", "refused"} == set(outcomes)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        counts = {"read": 0, "refused": 0}
        for seed in range(int(sys.argv[1])):
            rng = random.Random(1000 + seed)
            content = mutant(rng)
            try:
                counts[outcome(content, Path(folder) / "m.sdf", rng)] += 1
            except Exception as error:
                Path(f"mutant-{seed}.sdf").write_text(content)
                print(seed, type(error).__name__, str(error)[:300], flush=True)
        print(counts)
