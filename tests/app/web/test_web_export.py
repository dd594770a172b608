"""The panel of exports: every file is downloaded and read again."""

from __future__ import annotations

import io
import zipfile

from support.panel_pages import PATIENT, visited

import mbs
from mbs.app.tasks.options import keywords
from mbs.app.web.panels.export import open_export
from mbs.app.web.panels.options_form import first_values, form_texts
from mbs.export.fmu.options import FmuOptions


async def _downloaded(user, marker):
    user.find(marker=marker).click()
    return (await user.download.next(timeout=30)).content


def test_a_visitor_downloads_every_file(monkeypatch, tmp_path):
    async def visit(user, app):
        for marker in ("toml", "par"):
            path = tmp_path / f"robot.{marker}"
            path.write_bytes(await _downloaded(user, marker))
            assert mbs.load(path).assemble().nq == 2
        archive = zipfile.ZipFile(io.BytesIO(await _downloaded(user, "c-library")))
        assert "planar_2r/planar_2r.h" in archive.namelist()
        assert (await _downloaded(user, "html")).lstrip().startswith(b"<!")

    visited(open_export, "planar_2r", visit, monkeypatch)


def test_the_options_reach_the_fmu(monkeypatch):
    async def visit(user, app):
        user.find(marker="stop_time").clear().type("3")
        user.find(marker="more_outputs").type("wrench:j2, energies:kinetic")
        for field, value in (("fmi", "3.0"), ("outputs", ["closure"])):
            (element,) = user.find(marker=field).elements
            element.value = value
        archive = zipfile.ZipFile(io.BytesIO(await _downloaded(user, "fmu")))
        text = archive.read("modelDescription.xml").decode()
        assert 'fmiVersion="3.0"' in text
        assert 'stopTime="3.0"' in text
        for name in ("closure", "j2.f.x", "energy.kinetic"):
            assert f'name="{name}"' in text

    visited(open_export, "four_bar", visit, monkeypatch)


def test_a_wrong_option_is_told(monkeypatch):
    async def visit(user, app):
        user.find(marker="more_parameters").type("M99")
        user.find(marker="fmu").click()
        await user.should_see("'M99'", retries=PATIENT)

    visited(open_export, "planar_2r", visit, monkeypatch)


def test_names_stand_between_commas_or_blanks():
    values = first_values(FmuOptions) | {"more_inputs": " j1.q,, tool.wrench ", "max_step": " "}
    texts = form_texts(FmuOptions, values | {"outputs": ["energy"]})
    assert texts["inputs"] == ("j1.q", "tool.wrench")
    assert texts["outputs"] == ("energy",)
    assert keywords(FmuOptions, texts, "x") == {
        "fmi": "2.0",
        "inputs": ("j1.q", "tool.wrench"),
        "outputs": ("energy",),
        "parameters": (),
        "stop_time": 10.0,
        "step_size": 0.01,
        "tolerance": 1e-8,
        "solver": "dopri5",
        "internal_step": 0.001,
    }
