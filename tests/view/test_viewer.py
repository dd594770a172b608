"""The viewer in a browser: it draws, moves, asks for nothing outside and complains of nothing."""

import base64
import io
import shutil

import numpy as np
import pytest
from support.browser_app import ARGUMENTS, NAMES

import mbs

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
images = pytest.importorskip("PIL.Image", reason="pictures need matplotlib")
BROWSER = next(filter(None, map(shutil.which, NAMES)), None)
pytestmark = [
    pytest.mark.skipif(BROWSER is None, reason="no chromium is installed"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=BROWSER, args=ARGUMENTS)
        yield chromium
        chromium.close()


@pytest.fixture
def opened(browser, tmp_path):
    """A function that opens a picture; at the end nothing was asked for or complained of."""
    context = browser.new_context(viewport={"width": 360, "height": 300}, color_scheme="light")
    page = context.new_page()
    asked, told = [], []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: told.append(str(error)))
    page.on("console", lambda line: told.append(line.text) if line.type == "error" else None)

    def open_(picture):
        path = tmp_path / "picture.html"
        picture.save(path)
        page.goto(path.as_uri())
        page.wait_for_selector(".mbs-bar button")
        return page

    yield open_
    context.close()
    assert told == []
    assert {url.partition(":")[0] for url in asked} <= {"file", "data", "blob"}


def pixels(page):
    """(n, 3) colours of the picture."""
    _, _, data = page.evaluate("mbs.page.screenshot()").partition(",")
    with images.open(io.BytesIO(base64.b64decode(data))) as picture:
        return np.asarray(picture.convert("RGB")).astype(int).reshape(-1, 3)


def changed(first, second):
    return (np.abs(first - second).max(axis=1) > 40).mean()


def test_a_picture_is_drawn_and_moves(opened, assembled):
    system = assembled("rx90")
    picture = mbs.view.show(system)
    page = opened(picture)
    page.evaluate("mbs.page.setVisible('grid', false)")
    first = pixels(page)
    assert 0.01 < (np.abs(first - first[0]).max(axis=1) > 60).mean() < 0.5
    page.evaluate("poses => mbs.page.setPoses(poses)", picture.scene.poses({"q2": 0.8, "q3": 0.4}))
    second = pixels(page)
    assert changed(first, second) > 0.01
    page.evaluate("poses => mbs.page.setPoses(poses)", picture.scene.poses())
    assert changed(first, pixels(page)) == 0


def test_roles_cameras_and_themes(opened, assembled):
    page = opened(mbs.view.show(assembled("four_bar")))
    seen = {"first": pixels(page)}
    for name in ("front", "side", "top", "fit", "iso"):
        page.evaluate(f"mbs.page.setCamera('{name}')")
        seen[name] = pixels(page)
    assert changed(seen["front"], seen["side"]) > 0.01
    assert changed(seen["top"], seen["side"]) > 0.01
    assert changed(seen["top"], seen["fit"]) < 0.002
    for role, shown in (("label", True), ("link frame", True), ("loop", False), ("link", False)):
        before = pixels(page)
        page.evaluate("([role, shown]) => mbs.page.setVisible(role, shown)", [role, shown])
        assert (before != pixels(page)).any(axis=1).mean() > 0.0005
    page.evaluate("mbs.page.setTheme('dark')")
    assert pixels(page)[0].max() < 60
    page.evaluate("mbs.page.setTheme('auto')")
    assert pixels(page)[0].min() > 200
    page.emulate_media(color_scheme="dark")
    assert page.evaluate("mbs.page.theme") == "dark"


def test_a_film_plays_stops_and_is_wound(opened, swing):
    film = mbs.view.animate(swing, fps=20)
    page = opened(film)
    assert page.evaluate("mbs.page.playing")
    page.click(".mbs-play")
    assert not page.evaluate("mbs.page.playing")
    frames = []
    for time in (0.0, 0.5, 1.0):
        page.evaluate(f"mbs.page.seek({time})")
        frames.append(pixels(page))
    assert changed(frames[0], frames[1]) > 0.005
    assert changed(frames[1], frames[2]) > 0.005
    assert page.inner_text("output") == "1.00 s"
    assert float(page.input_value(".mbs-time")) == pytest.approx(1.0)
    page.evaluate("mbs.page.seek(0.525)")
    matrix = page.evaluate("mbs.page.links[1].matrix.toArray()")
    between = (film.poses[10] + film.poses[11])[12:24].reshape(3, 4) / 2
    assert np.abs(np.array(matrix).reshape(4, 4).T[:3] - between).max() < 1e-5


def test_another_scene_takes_the_place_of_the_first(opened, assembled):
    page = opened(mbs.view.show(assembled("planar_2r")))
    first = pixels(page)
    other = mbs.view.scene(assembled("flyball_governor"))
    page.evaluate(
        "scene => { mbs.page.setScene(scene); mbs.page.setCamera('iso'); }", other.as_dict()
    )
    assert changed(first, pixels(page)) > 0.01
    assert page.evaluate("mbs.page.stretched.length") == sum(
        "links" in item for item in other.as_dict()["primitives"]
    )
    page.evaluate("mbs.page.dispose()")
    assert page.query_selector("canvas") is None
