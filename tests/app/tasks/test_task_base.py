"""Base parameters as a table, and as comma-separated values."""

import csv
import io
import pickle

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.app.tasks.base import base
from mbs.errors import ModelError
from mbs.identification import base_parameters, symbolic_parameters


def test_the_table_of_the_rx90_is_that_of_the_model():
    rx90 = catalogue_system("rx90")
    table, found = base(rx90), base_parameters(rx90)
    assert len(table.rows) == found.count == 52
    assert tuple(row.name for row in table.rows) == found.names
    assert table.total == len(found.columns)
    grouped = {row.name: row.expression for row in table.rows}
    assert grouped["Fv1"] == "Fv1"
    assert grouped["ZZ1R"].startswith("ZZ1 + Ia1 + YY2")
    names = {c.name for c in found.columns}
    kept = {c.name for c in found.kept}
    assert {*table.without_effect, *table.grouped, *kept} == names
    assert not set(table.without_effect) & set(table.grouped)
    assert pickle.loads(pickle.dumps(table)) == table


def test_values_are_the_groupings_of_the_description():
    rx90 = catalogue_system("rx90")
    found = base_parameters(rx90)
    K = np.array(casadi.DM(symbolic_parameters(rx90, found.columns))).ravel()
    values = [row.value for row in base(rx90).rows]
    assert np.allclose(values, found.matrix @ K)
    assert np.abs(values).max() > 1


def test_csv_reads_back():
    four_bar = catalogue_system("four_bar")
    table = base(four_bar, "numeric")
    rows = list(csv.DictReader(io.StringIO(table.csv())))
    assert [row["name"] for row in rows] == [row.name for row in table.rows]
    assert [float(row["value"]) for row in rows] == [row.value for row in table.rows]
    assert (table.method, len(rows)) == ("numeric", 14)


def test_a_symbol_without_value_leaves_its_parameter_without():
    arm = mbs.load(
        {
            "name": "arm",
            "gravity": [0, 0, -9.81],
            "frame": [{"antecedent": 0, "alpha": "pi/2"}],
            "body": [{"frame": 1, "MX": "MX1", "ZZ": 0.2, "Ia": 0.1}],
        }
    ).assemble()
    values = {row.name: row.value for row in base(arm).rows}
    assert values["MX1"] is None
    assert values["ZZ1R"] == pytest.approx(0.3)


def test_an_unknown_method_is_refused():
    with pytest.raises(ModelError, match="use 'symbolic' or 'numeric'"):
        base(catalogue_system("planar_2r"), "guess")
