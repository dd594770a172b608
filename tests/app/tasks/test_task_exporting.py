"""Files of a system as bytes: compiled, read again, simulated."""

from __future__ import annotations

import io
import re
import zipfile

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.messages import refused

import mbs
from mbs.app.tasks.exporting import c_library, file_stem, fmu, html, par, toml
from mbs.errors import ExportError, ExpressionError, ModelError


@pytest.fixture(scope="module")
def four_bar():
    return catalogue_system("four_bar")


def test_a_c_library_is_what_the_exporter_writes(four_bar, tmp_path):
    archive = zipfile.ZipFile(io.BytesIO(c_library(four_bar, ("idm", "velocity-closure"))))
    models = {
        "idm": mbs.models.inverse_dynamics(four_bar),
        "velocity_closure": mbs.models.velocity_closure(four_bar),
    }
    folder = mbs.export.c_library(models, tmp_path / "four_bar")
    assert sorted(archive.namelist()) == sorted(f"four_bar/{p.name}" for p in folder.iterdir())
    for path in folder.iterdir():
        assert archive.read(f"four_bar/{path.name}") == path.read_bytes()
    assert b"int idm_eval(" in archive.read("four_bar/four_bar.c")
    assert c_library(four_bar, ("idm",)) == c_library(four_bar, ("idm",))


def test_options_reach_the_model(four_bar):
    archive = zipfile.ZipFile(
        io.BytesIO(c_library(four_bar, ("idm",), {"idm": {"coordinates": "tree"}}))
    )
    header = archive.read("four_bar/four_bar.h").decode()
    assert re.search(r"@param\[in\]  v +\(3, 1\)", header)


def test_the_general_inverse_model_is_exported_whole():
    """As source text its characteristic matrices are written, in C all configurations."""
    content = c_library(catalogue_system("crx10"), ["igm-general"])
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        header = archive.read("crx10/crx10.h").decode()
    assert "igm_general(T) -> q, valid, count, certain" in header


def test_an_fmu_moves_like_the_system(four_bar, tmp_path):
    settings = dict(
        fmi="3.0", outputs=("closure",), stop_time="0.4", step_size=0.02, solver="rodas"
    )
    path = tmp_path / "four_bar.fmu"
    path.write_bytes(fmu(four_bar, settings))
    moved = mbs.simulate.fmu(path, inputs={"j1.tau": 1.0}, quiet=True)
    direct = mbs.simulate.run(four_bar, 0.4, tau={"j1": 1.0}, step=0.02, quiet=True)
    np.testing.assert_allclose(moved.time, direct.time, atol=1e-12)
    np.testing.assert_allclose(moved["j1.q"], direct["j1.q"], atol=1e-6)
    assert moved["closure"].max() < 1e-8


@pytest.mark.parametrize(("write", "suffix"), [(par, ".par"), (toml, ".toml")])
def test_robot_files_read_back_as_the_same_dynamics(four_bar, tmp_path, write, suffix):
    path = tmp_path / f"robot{suffix}"
    path.write_bytes(write(four_bar))
    again = mbs.load(path).assemble()
    rng = np.random.default_rng(1)
    v, a = rng.normal(size=(2, 1))
    given, read = (
        mbs.models.inverse_dynamics(s)(mbs.loops.solve(s, {s.coordinates[0].name: 0.7}), v, a)
        for s in (four_bar, again)
    )
    np.testing.assert_allclose(np.array(read), np.array(given), rtol=1e-9)


def test_toml_keeps_names_ranges_and_configuration(tmp_path):
    for name in ("panda", "sr400"):
        system = catalogue_system(name)
        path = tmp_path / f"{name}.toml"
        path.write_bytes(toml(system))
        again = mbs.load(path).assemble()
        assert again.name == system.name
        assert [c.name for c in again.coordinates] == [c.name for c in system.coordinates]
        assert [c.limits for c in again.coordinates] == [c.limits for c in system.coordinates]
        assert [s.limits for s in again.velocity_coordinates] == [
            s.limits for s in system.velocity_coordinates
        ]
        assert [s.effort for s in again.velocity_coordinates] == [
            s.effort for s in system.velocity_coordinates
        ]
        np.testing.assert_allclose(again.configuration, system.configuration, atol=1e-9)


def test_a_picture_loads_nothing(four_bar):
    text = html(four_bar).decode()
    assert "<html" in text
    assert not re.search(r"(?:src|href)\s*=\s*[\"']https?:", text)


def test_file_names_are_safe():
    table = {"name": "../../a b:c", "frame": [{"antecedent": 0}], "body": [{"frame": 1, "ZZ": 1}]}
    assert file_stem(mbs.load(table).assemble()) == "a_b_c"


def test_mistakes_are_refused_with_a_sentence(four_bar):
    refused(ModelError, "'nope'", by=lambda: c_library(four_bar, ["nope"]))
    refused(ModelError, "igm-paul", "no Function", by=lambda: c_library(four_bar, ["igm-paul"]))
    refused(ModelError, "no model is chosen", by=lambda: c_library(four_bar, []))
    refused(ModelError, "'euler'", by=lambda: fmu(four_bar, dict(solver="euler")))
    refused(ExportError, "'4.0'", by=lambda: fmu(four_bar, dict(fmi="4.0")))
    refused(ExpressionError, "stop_time", by=lambda: fmu(four_bar, dict(stop_time="1/0")))
    refused(ModelError, "'nope'", by=lambda: fmu(four_bar, dict(outputs=("nope",))))
    bicycle = catalogue_system("whipple_bicycle")
    refused(ModelError, "rear_contact", by=lambda: toml(bicycle))
