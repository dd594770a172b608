"""Mutants of a URDF file: each is read, with notes or without, or refused in one sentence.

By hand, for more of them: python tests/formats/test_urdf_mutants.py 5000
"""

import random
import re
import sys
import tempfile
from pathlib import Path

import pytest

import mbs
from mbs.errors import MbsError

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
WORDS = (
    *("", " ", "nan", "inf", "-inf", "-1", "0", "1e308", "-1e-320", "1,5", "0x1p3", "1_0", "٣"),
    *("${x}", "$(arg y)", "true", "1 2 3", "base", "world", "shoulder", "tool", "root_joint"),
    *("a.b", "'", "é", "\ud7ff", "\u202e", "x" * 300, "&amp;", "&unknown;", "<", ">", "--"),
    *("floating", "planar", "fixed", "revolute", "../../x", "name", "link", "<![CDATA[", "]]>"),
)


def mutant(rng):
    """The file with one to four changes, as bytes."""
    text = ARM
    for _ in range(rng.choice((1, 1, 2, 3))):
        text = rng.choice((*(_word, _element) * 4, _swapped, _cut, _copied, _letter))(rng, text)
    content = bytearray(text.encode(rng.choice(("utf-8",) * 12 + ("latin-1", "utf-16")), "replace"))
    for _ in range(rng.choice((0,) * 12 + (1, 3))):
        content[rng.randrange(len(content))] = rng.randrange(256)
    return bytes(content)


def _values(text):
    """Where the values of attributes stand."""
    marks = [k for k, letter in enumerate(text) if letter == '"']
    return [(a + 1, b) for a, b in zip(marks[::2], marks[1::2], strict=False)] or [(0, 0)]


def _word(rng, text):
    a, b = rng.choice(_values(text))
    return text[:a] + rng.choice(WORDS) + text[b:]


def _swapped(rng, text):
    (a, b), (c, d) = sorted(rng.choice(_values(text)) for _ in range(2))
    return text if c < b else text[:a] + text[c:d] + text[b:c] + text[a:b] + text[d:]


def _span(rng, text):
    """From one `<` to a later one, or any piece."""
    marks = [k for k, letter in enumerate(text) if letter == "<"] or [0]
    a = rng.choice(marks if rng.random() < 0.8 else range(len(text) or 1))
    later = [k for k in marks if k > a][:8]
    return a, rng.choice(later) if later else len(text)


def _element(rng, text):
    """An element without content is left out, stands twice or stands elsewhere."""
    elements = [found.span() for found in re.finditer(r"<[^<>]*/>", text)]
    if not elements:
        return text
    (a, b), (c, d) = rng.choice(elements), rng.choice(elements)
    one = text[a:b]
    match rng.randrange(3):
        case 0:
            return text[:a] + text[b:]
        case 1:
            return text[:b] + one + text[b:]
    return text[:d] + one + text[d:] if rng.random() < 0.5 else text[:a] + text[c:d] + text[b:]


def _cut(rng, text):
    a, b = _span(rng, text)
    return text[:a] + text[b:]


def _copied(rng, text):
    a, b = _span(rng, text)
    at = rng.choice([k for k, letter in enumerate(text) if letter == "<"] or [0])
    return text[:at] + text[a:b] + text[at:]


def _letter(rng, text):
    at = rng.randrange(len(text) or 1)
    return text[:at] + rng.choice("<>/\"'=& \n\0a1.-") + text[at + 1 :]


def outcome(content, path, rng):
    """What becomes of a mutant: "read" or "refused"; anything else is raised."""
    path.write_bytes(content)
    base = rng.choice((None, None, "fixed", "free"))
    try:
        mechanism = mbs.load(path, base=base)
        for note in mechanism.notes:
            assert "\n" not in str(note)
            assert len(str(note)) < 500
        if any(True for _ in mechanism.joints()):
            mechanism.assemble()
    except MbsError as error:
        text = str(error)
        assert "\n" not in text, text
        assert len(text.replace(str(path), "")) < 1200, text
        return "refused"
    return "read"


@pytest.mark.parametrize("seed", range(6))
def test_a_sentence_or_notes(tmp_path, seed):
    rng = random.Random(seed)
    outcomes = [outcome(mutant(rng), tmp_path / "arm.urdf", rng) for _ in range(50)]
    assert {"read", "refused"} == set(outcomes)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        counts = {"read": 0, "refused": 0}
        for seed in range(int(sys.argv[1])):
            rng = random.Random(1000 + seed)
            content = mutant(rng)
            try:
                counts[outcome(content, Path(folder) / "arm.urdf", rng)] += 1
            except Exception as error:
                Path(f"mutant-{seed}.urdf").write_bytes(content)
                print(seed, type(error).__name__, str(error)[:300], flush=True)
        print(counts)
