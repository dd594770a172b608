"""The panel of identification: a record is uploaded, tables and residuals are shown."""

from __future__ import annotations

import pytest
from nicegui import ui
from nicegui.elements.upload_files import SmallFileUpload
from support.panel_pages import PATIENT, visited

import mbs
from mbs.app.tasks.simulation import SimulationSettings, csv_bytes, simulate
from mbs.app.web.panels.identification import open_identification


@pytest.fixture(scope="module")
def record():
    arm = mbs.load("planar_2r").assemble()
    laws = {"q1.q": "0.5*sin(2*t) + 0.3*cos(5*t)", "q2.q": "0.7*sin(3*t) + 0.2*cos(7*t)"}
    settings = SimulationSettings(duration=6, motion=laws)
    return csv_bytes(simulate(arm, settings, quiet=True))


async def _upload(user, content):
    (upload,) = user.find(ui.upload).elements
    await upload.handle_uploads([SmallFileUpload("day1.csv", "text/csv", content)])


def test_a_visitor_identifies_from_a_record(monkeypatch, record):
    async def visit(user, app):
        await user.should_see("q1.tau, q2.tau")
        user.find(marker="identify").click()
        await user.should_see("there is no record yet", retries=PATIENT)
        await _upload(user, record)
        await user.should_see("day1.csv")
        user.find(marker="identify").click()
        await user.should_see(marker="identified", retries=PATIENT)
        parameters, errors = sorted(user.find(ui.table).elements, key=lambda table: table.id)
        rows = {row["name"]: row for row in parameters.rows}
        assert float(rows["MX1R"]["value"]) == pytest.approx(1.5, rel=1e-4)
        assert (rows["MX1R"]["grouping"], rows["ZZ2"]["grouping"]) == ("MX1 + M2", "")
        assert rows["Fv1"]["percent"] == "-" or rows["Fv1"]["percent"].endswith("*")
        assert [row["name"] for row in errors.rows] == ["q1", "q2"]
        user.find(marker="found").elements.pop().value = "Residuals"
        await user.should_see(marker="residual-chart", retries=PATIENT)
        assert len(user.find(ui.echart).elements) == 4
        user.find(marker="found").elements.pop().value = "Report"
        await user.should_see("Identification by weighted least squares", retries=PATIENT)
        user.find(marker="file-estimates").click()
        response = await user.download.next()
        assert response.text.startswith("name,value,deviation")

    visited(open_identification, "planar_2r", visit, monkeypatch)


def test_a_wrong_record_is_refused_with_its_sentence(monkeypatch):
    async def visit(user, app):
        await _upload(user, b"time,q1.q\n0,0\n")
        user.find(marker="identify").click()
        await user.should_see("there is no column 'q2.q' in the file", retries=PATIENT)

    visited(open_identification, "planar_2r", visit, monkeypatch)
