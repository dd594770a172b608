"""Pictures and films: what they show, the files they write, and what they refuse."""

import base64
import json
import pickle
import re

import numpy as np
import pytest

import mbs
from mbs.errors import ExportError, ModelError, Unclosable


def arguments(html):
    """The scene and the options that an HTML file starts with."""
    text = html[html.index("mbs.page = mbs.bar(") :]
    text = text[
        text.index(", ") + 2 : text.index(");</script>" if ");</script>" in text else ");\n")
    ]
    scene, end = json.JSONDecoder().raw_decode(text)
    return scene, json.loads(text[end:].lstrip(", "))


def test_an_html_file_holds_everything(assembled, tmp_path):
    path = tmp_path / "puma.html"
    picture = mbs.view.show(assembled("puma560"), {"q1": 0.5}, path, view="top", shown=["label"])
    html = path.read_text(encoding="utf-8")
    assert html == picture.html
    assert "default-src 'none'" in html
    assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", html)
    assert "@import" not in html
    assert len(html.encode()) < 620_000
    scene, options = arguments(html)
    assert options == {"view": "top", "theme": "auto", "motion": None}
    assert scene["hidden"] == ["link frame"]
    assert scene["poses"][12] == pytest.approx(np.cos(0.5), abs=1e-12)


def test_a_notebook_shows_it_in_a_frame_of_its_own(assembled):
    html = mbs.view.show(assembled("planar_2r"))._repr_html_()
    assert html.startswith('<iframe sandbox="allow-scripts')
    assert html.count("<") == 2
    assert "srcdoc=" in html


def test_names_cannot_break_out_of_the_page():
    m = mbs.Mechanism("</script><script>alert(1)</script>")
    rod = m.add(mbs.components.Body("rod", mass=1, com=(0, 0, -1)))
    m.connect(m.world, mbs.components.Revolute("</script><b>", axis="x"), rod)
    system = m.assemble()
    html = mbs.view.show(system).html
    assert "alert(1)</script>" not in html
    assert "</script><b>" not in html
    assert "</script><b>" not in system.draw().svg


def test_loops_are_closed_at_the_positions_that_are_named(assembled):
    system = assembled("four_bar")
    picture = mbs.view.show(system, {"j1": 0.9})
    q = mbs.loops.solve(system, {"j1": 0.9})
    assert np.array_equal(picture.scene.q, q)
    given = mbs.view.show(system, [0.1, 0.2, 0.3])
    assert given.scene.q == (0.1, 0.2, 0.3)
    with pytest.raises(Unclosable):
        mbs.view.show(assembled("delta"), {"q1": 40.0})


def test_a_film_follows_the_result(swing, assembled):
    system = assembled("four_bar")
    film = mbs.view.animate(swing, fps=20)
    assert film.poses.shape == (21, 12 * 4)
    q = [swing[f"{c.name}.q"] for c in system.coordinates]
    for k in (0, 7, 20):
        expected = film.scene.poses([row[k] for row in q])
        assert np.abs(film.poses[k] - expected).max() < 1e-9
    slow = mbs.view.animate(swing, fps=20, speed=0.5)
    assert len(slow.times) == 41
    _, options = arguments(slow.html)
    packed = np.frombuffer(base64.b64decode(options["motion"]["packed"]), "<f4")
    assert np.abs(packed.reshape(41, -1) - slow.poses).max() < 1e-6
    assert options["motion"]["speed"] == 0.5
    assert options["motion"]["times"] == pytest.approx(slow.times, abs=1e-6)


def test_bounds_hold_the_whole_motion(swing):
    film = mbs.view.animate(swing, fps=10)
    places = film.poses.reshape(len(film.times), -1, 3, 4)[..., 3]
    center, radius = np.array(film.scene.bounds.center), film.scene.bounds.radius
    assert np.linalg.norm(places - center, axis=-1).max() < radius
    up = np.array(film.scene.up)
    assert (places @ up).min() >= np.array(film.scene.floor.center) @ up - 1e-12


def test_results_know_their_system_until_they_are_pickled(swing, assembled, tmp_path):
    assert swing.system is assembled("four_bar")
    copy = pickle.loads(pickle.dumps(swing))
    assert copy.system is None
    assert np.array_equal(copy.values, swing.values)
    assert dict(copy.units) == dict(swing.units)
    with pytest.raises(ModelError, match=r"'four_bar' does not know whose motion it is"):
        mbs.view.animate(copy)
    assert len(mbs.view.animate(copy, assembled("four_bar"), fps=5).times) == 6
    swing.save(tmp_path / "run.npz")
    assert mbs.Result.load(tmp_path / "run.npz").system is None


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"view": "left"}, "there is no view 'left'"),
        ({"theme": "pink"}, "there is no theme 'pink'"),
        ({"shown": ["labels"]}, "there is no role 'labels'; did you mean 'label'"),
        ({"fps": 0}, "fps is 0; give a number above zero"),
        ({"speed": float("nan")}, "speed is nan"),
        ({"fps": 1e6}, "1000000 pictures are more than 5000"),
        ({"system": "four_bar"}, "give what assemble() returns"),
    ],
)
def test_options_that_mean_nothing_are_refused(swing, options, words):
    with pytest.raises(ModelError, match=re.escape(words)):
        mbs.view.animate(swing, **options)


def test_results_of_other_mechanisms_are_refused(swing, assembled):
    with pytest.raises(ModelError, match=r"has no signal 'q1.q', which a motion of puma560 has"):
        mbs.view.animate(swing, assembled("puma560"))
    with pytest.raises(ModelError, match="is no Result"):
        mbs.view.animate("run.npz")
    short = mbs.Result([0.0], np.zeros((1, 1)), {"j1.q": "rad"}, "short")
    with pytest.raises(ModelError, match="'short' covers no time"):
        mbs.view.animate(short, assembled("four_bar"))


def test_files_that_cannot_be_made_are_refused(swing, assembled, tmp_path):
    still = mbs.view.show(assembled("four_bar"))
    with pytest.raises(ExportError, match=r"the ending is '.bmp'; use .html, .png, .svg, .gif or"):
        still.save(tmp_path / "a.bmp")
    with pytest.raises(ExportError, match="the picture does not move"):
        still.save(tmp_path / "a.gif")
    with pytest.raises(ExportError, match="cannot be written"):
        still.save(tmp_path / "nowhere" / "a.html")
    assert list(tmp_path.iterdir()) == []
