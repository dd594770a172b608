"""Pictures made without a browser: faces, PNG, SVG, GIF and MP4."""

import os
import stat
import subprocess
import sys
import xml.etree.ElementTree as ET

import numpy as np
import pytest

import mbs
from mbs.errors import ExportError
from mbs.view.mesh import faces_of, revolve, rotation_onto, stretch
from mbs.view.painter import camera
from mbs.view.primitives import (
    BallShape,
    BarShape,
    BoxShape,
    CylinderShape,
    FrameShape,
    RingShape,
    SpanShape,
)

images = pytest.importorskip("PIL.Image", reason="pictures need matplotlib")

FLAT = tuple(np.eye(3, 4).ravel())


def normals(corners):
    return np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]) / 2


@pytest.mark.parametrize(
    ("item", "volume"),
    [
        (BallShape("link", 0, "joint", (1, 2, 3), 0.5), 4 / 3 * np.pi * 0.125),
        (CylinderShape("link", 0, "joint", (1, 0, 0), (1, 2, 0), 0.5), np.pi * 0.5),
        (CylinderShape("link", 0, "joint", (1, 0, 0), (1, 2, 0), 0.5, 0.3), np.pi * 0.32),
        (BarShape("link", 0, "joint", (0, 0, 0), (0, 3, 4), 0.5), np.pi * (1.25 + 0.5 / 3)),
        (BoxShape("link", 0, "joint", FLAT, (1, 2, 3)), 6.0),
        (RingShape("link", 0, "joint", (0, 0, 0), (0, 1, 0), 2.0, 0.3), 2 * np.pi**2 * 2 * 0.09),
    ],
)
def test_faces_enclose_a_solid_and_look_outwards(item, volume):
    (faces,) = faces_of(item, 1.0)
    corners = faces.corners
    enclosed = (corners.mean(axis=1) * normals(corners)).sum() / 3
    assert 0.86 * volume < enclosed < 1.001 * volume
    assert np.abs(normals(corners).sum(axis=0)).max() < 1e-12


def test_a_frame_has_three_arrows_of_its_length():
    arrows = list(faces_of(FrameShape("frame", 0, FLAT, 0.5), 1.0))
    assert [arrow.colour for arrow in arrows] == ["axes.0", "axes.1", "axes.2"]
    for k, arrow in enumerate(arrows):
        assert arrow.corners[..., k].max() == pytest.approx(0.5, abs=1e-15)


def test_a_turn_takes_z_to_a_direction():
    for direction in np.random.default_rng(1).normal(size=(5, 3)):
        R = rotation_onto(direction)
        assert np.abs(R @ R.T - np.eye(3)).max() < 1e-14
        assert np.abs(R[:, 2] - direction / np.linalg.norm(direction)).max() < 1e-14
    assert np.array_equal(rotation_onto(np.zeros(3)), np.eye(3))
    assert revolve(np.array([[1.0, 0.0], [1.0, 1.0]]), 6).shape == (6, 4, 3)


def test_what_is_stretched_reaches_from_end_to_end():
    a, b = np.array([1.0, 0, 0]), np.array([1.0, 2.0, 0])
    corners = stretch(
        SpanShape("joint", (0, 1), "joint", ((0, 0, 0), (0, 0, 0)), 0.1), a, b
    ).corners
    assert np.allclose(corners[..., 1].min(), 0)
    assert np.allclose(corners[..., 1].max(), 2)


def test_the_middle_of_the_scene_is_the_middle_of_the_picture(assembled):
    scene = mbs.view.scene(assembled("puma560"))
    for view in scene.views:
        flat, depth = camera(scene, view).seen(np.array(scene.bounds.center))
        assert np.abs(flat).max() < 1e-12
        assert depth < -scene.bounds.radius


def pixels(path):
    with images.open(path) as picture:
        return np.asarray(picture.convert("RGB")).astype(int)


def test_a_still_picture_shows_the_mechanism(assembled, tmp_path):
    system = assembled("puma560")
    shown = []
    for number, q in enumerate((None, {"q2": -0.6})):
        path = tmp_path / f"{number}.png"
        mbs.view.show(system, q, path)
        shown.append(pixels(path))
    background = np.array([246, 247, 249])
    drawn = np.abs(shown[0] - background).max(axis=2) > 60
    assert 0.01 < drawn.mean() < 0.5
    assert (np.abs(shown[0] - shown[1]).max(axis=2) > 60).mean() > 0.005
    orange = np.abs(shown[0] - [232, 135, 30]).max(axis=2) < 60
    assert orange.sum() > 200
    dark = tmp_path / "dark.png"
    mbs.view.show(system, path=dark, theme="dark")
    assert pixels(dark)[2, 2].tolist() == [21, 24, 29]


def test_a_drawing_is_well_formed_and_has_labels(assembled, tmp_path):
    path = tmp_path / "sr400.svg"
    mbs.view.show(assembled("sr400"), path=path, shown=["label"])
    text = path.read_text()
    assert len(list(ET.fromstring(text).iter("{http://www.w3.org/2000/svg}path"))) > 300
    assert 'id="q9"' in text
    again = tmp_path / "again.svg"
    mbs.view.show(assembled("sr400"), path=again, shown=["label"])
    assert again.read_text() == text


def test_a_gif_moves(swing, tmp_path):
    path = tmp_path / "swing.gif"
    mbs.view.animate(swing, fps=8).save(path)
    with images.open(path) as film:
        assert film.n_frames == 9
        assert film.info["duration"] == 120
        assert film.info["loop"] == 0
        first = np.asarray(film.convert("RGB")).astype(int)
        film.seek(5)
        later = np.asarray(film.convert("RGB")).astype(int)
    assert (np.abs(first - later).max(axis=2) > 60).mean() > 0.005


def stand_in(folder, body):
    """A program of the name ffmpeg that a test understands."""
    program = folder / "ffmpeg"
    program.write_text(f"#!{sys.executable}\nimport sys\ndata = sys.stdin.buffer.read()\n{body}\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)


@pytest.mark.skipif(os.name == "nt", reason="the stand-in is a script")
def test_an_mp4_file_comes_from_ffmpeg(swing, tmp_path, monkeypatch):
    picture = mbs.view.animate(swing, fps=4)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ExportError, match=r"ffmpeg, which makes \.mp4 files, was not found"):
        picture.save(tmp_path / "swing.mp4")
    stand_in(tmp_path, "open(sys.argv[-1], 'w').write(' '.join([*sys.argv[1:-1], str(len(data))]))")
    picture.save(tmp_path / "swing.mp4")
    words = (tmp_path / "swing.mp4").read_text().split()
    width, height = map(int, words[words.index("-s") + 1].split("x"))
    assert width % 2 == height % 2 == 0
    assert int(words[-1]) == 5 * width * height * 3
    assert words[words.index("-r") + 1] == "4"
    stand_in(tmp_path, "sys.exit('no such codec')")
    with pytest.raises(ExportError, match=r"ffmpeg failed \(no such codec\)"):
        picture.save(tmp_path / "failed.mp4")
    assert not (tmp_path / "failed.mp4").exists()


def test_matplotlib_is_loaded_for_painted_pictures_alone():
    code = (
        "import sys, mbs; s = mbs.load('four_bar').assemble();"
        "len(mbs.view.show(s).html); s.draw(); print('matplotlib' in sys.modules)"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert answer.stdout.strip() == "False"
