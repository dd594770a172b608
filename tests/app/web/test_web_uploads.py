"""Uploaded files are data: whatever is in them, a document or one sentence comes back."""

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from mbs import MbsError
from mbs.app.web.document.document import Document

URDF = b"""<?xml version="1.0"?><robot name="arm"><link name="base"/><link name="a"><inertial>
<origin xyz="0 0 0.1" rpy="0 0 0"/><mass value="1.5"/><inertia ixx="0.1" iyy="0.1" izz="0.05"
ixy="0" ixz="0" iyz="0"/></inertial></link><link name="b"/><joint name="j1" type="revolute">
<parent link="base"/><child link="a"/><axis xyz="0 0 1"/><limit lower="-1" upper="1"/>
<dynamics damping="0.1" friction="0"/></joint><joint name="j2" type="prismatic"><parent link="a"/>
<child link="b"/><origin xyz="0 0 1"/><axis xyz="1 0 0"/><mimic joint="j1" multiplier="2"/></joint>
</robot>"""
MJCF = b"""<mujoco model="arm"><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>
<body name="a" pos="0 0 1"><joint name="j1" type="hinge" axis="0 1 0" damping="0.2"/>
<inertial pos="0 0 0.1" mass="1" diaginertia="0.1 0.1 0.05"/><body name="b" pos="0 0 0.5">
<joint name="j2" type="slide" axis="1 0 0" range="-1 1"/><geom type="sphere" size="0.1"/></body>
</body></worldbody><actuator><motor joint="j1"/></actuator></mujoco>"""
SDF = b"""<sdf version="1.9"><model name="arm"><link name="a"><inertial><pose>0 0 .1 0 0 0</pose>
<mass>1</mass><inertia><ixx>.1</ixx><iyy>.1</iyy><izz>.1</izz></inertia></inertial></link>
<joint name="j" type="revolute"><parent>world</parent><child>a</child><axis><xyz>0 1 0</xyz>
</axis></joint></model></sdf>"""
FILES = {
    ".toml": Document.of_name("sr400").toml().encode(),
    ".par": Document.of_name("sr400").par().encode(),
    ".urdf": URDF,
    ".sdf": SDF,
    ".xml": MJCF,
}
SPARE = [b"nan", b"-1e309", b"1/0", b"{", b"}", b"\x00", b"[[", b'"', b"<", b">", b"&a;", b"9" * 40]
QUICK = settings(
    max_examples=40,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)


def opened(content, suffix):
    """The document, or None where the file is refused with one sentence."""
    try:
        document = Document.of_upload(content, suffix)
    except MbsError as error:
        sentence = str(error)
        document = None
    if document is None:
        assert len(sentence) > 10
        assert "Traceback" not in sentence
        return None
    for problem in document.problems:
        assert problem.sentence
    return document


@st.composite
def mutated(draw, content):
    """The file with some pieces cut out, doubled or replaced."""
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(content)))
        stop = min(start + draw(st.integers(0, 40)), len(content))
        piece = draw(st.one_of(st.sampled_from(SPARE), st.binary(max_size=6), st.just(b"")))
        twice = content[start:stop] if draw(st.booleans()) else b""
        content = content[:start] + piece + twice + content[stop:]
    return content


@pytest.mark.parametrize("suffix", FILES)
def test_the_files_themselves_are_read(suffix):
    document = opened(FILES[suffix], suffix)
    assert document is not None
    assert document.system().nq in (1, 2, 8)


@pytest.mark.parametrize("suffix", FILES)
def test_random_bytes_are_refused_or_read(suffix):
    @QUICK
    @given(st.binary(max_size=300))
    @example(b"")
    @example(b"\xff\xfe" * 20)
    def check(content):
        opened(content, suffix)

    check()


@pytest.mark.parametrize("suffix", FILES)
def test_mutated_files_are_refused_or_read(suffix):
    @QUICK
    @given(mutated(FILES[suffix]))
    def check(content):
        opened(content, suffix)

    check()


@pytest.mark.parametrize(
    ("suffix", "content"),
    [
        (".toml", b"a = " + b"[" * 5000),
        (".toml", b'name = "x"\n[[frame]]\nantecedent = 0\nd = "' + b"(" * 3000 + b'"'),
        (".toml", b'name = "x"\n[[frame]]\nantecedent = 0\nd = "' + b"9^" * 200 + b'9"'),
        (".toml", b'name = "x"\n[[frame]]\nantecedent = ' + b"9" * 5000),
        (".par", b"NL = 999999999\nNJ = 999999999\nant = {0}\nsigma = {0}"),
        (".par", b"NL = 1\nNJ = 1\nant = {0}\nsigma = {0}\ntheta = {" + b"-" * 9000 + b"1}"),
        (".urdf", b"<a>" * 3000),
        (".urdf", b"<robot name='r'>" + b"<link name='l'>" * 3000),
        (".xml", b"<mujoco>" * 3000),
        (
            ".urdf",
            b"<!DOCTYPE r [<!ENTITY a 'aaaaaaaaaa'>"
            + b"".join(b"<!ENTITY %c '%s'>" % (98 + k, b"&%c;" % (97 + k) * 10) for k in range(12))
            + b"]><robot name='&m;'/>",
        ),
    ],
)
def test_bombs_are_refused_in_time(suffix, content):
    assert opened(content, suffix) is None


def test_a_file_cannot_make_its_reader_look_into_other_files(tmp_path):
    secret = tmp_path / "secret.xml"
    secret.write_text("<mujocoinclude><worldbody><body name='secret'/></worldbody></mujocoinclude>")
    (tmp_path / "secret.stl").write_bytes(b"solid secret\nendsolid secret\n")
    outside = [
        (".urdf", f"<!DOCTYPE r [<!ENTITY s SYSTEM '{secret.as_uri()}'>]><robot name='&s;'/>"),
        (".xml", f"<mujoco><include file='{secret}'/></mujoco>"),
        (".xml", f"<mujoco><include file='{os.path.relpath(secret, '/tmp/x')}'/></mujoco>"),
        (
            ".xml",
            f"<mujoco><asset><mesh name='m' file='{tmp_path}/secret.stl'/></asset><worldbody>"
            "<body><joint/><geom type='mesh' mesh='m'/></body></worldbody></mujoco>",
        ),
        (
            ".xml",
            f"<mujoco><compiler meshdir='{tmp_path}'/><asset><mesh name='m' file='secret.stl'/>"
            "</asset><worldbody><body><joint/><geom type='mesh' mesh='m'/></body></worldbody>"
            "</mujoco>",
        ),
        (".xml", f"<mujoco><asset><model name='m' file='{secret}'/></asset></mujoco>"),
        (".xml", "<mujoco><include file='robot.xml'/></mujoco>"),
        (".xml", "<mujoco><compiler assetdir='C:/Windows'/></mujoco>"),
    ]
    for suffix, text in outside:
        with pytest.raises(MbsError) as caught:
            Document.of_upload(text.encode(), suffix)
        assert "solid" not in str(caught.value)
        assert "other files" in str(caught.value) or suffix == ".urdf"


def test_nothing_is_left_of_an_upload(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    opened(URDF, ".urdf")
    opened(b"nonsense", ".xml")
    assert list(Path(tmp_path).iterdir()) == []
