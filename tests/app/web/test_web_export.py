"""The panel of exports: every file is downloaded and read again."""

from __future__ import annotations

import io
import zipfile

from support.panel_pages import PATIENT, visited

import mbs
from mbs.app.web.panels.export import FmuAsked, open_export


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
    settings = FmuAsked(more_inputs=" j1.q,, tool.wrench ", outputs=["energy"]).settings()
    assert settings.inputs == ("j1.q", "tool.wrench")
    assert settings.outputs == ("energy",)
