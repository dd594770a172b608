import csv
import dataclasses
import pickle
import sys

import numpy as np
import pytest

from mbs import Result
from mbs.errors import ExportError, ModelError


@pytest.fixture
def result():
    time = np.array([0.0, 0.5, 1.0])
    values = np.array([[0.0, 1.0, 7.0], [0.1, 2.0, 8.0], [0.2, 3.0, 1 / 3]])
    return Result(time, values, {"j1.q": "rad", "j2.q": "rad", "force": "N"}, "demo", {"rtol": 1})


def test_columns_have_names_and_units(result):
    assert result.names == ("j1.q", "j2.q", "force")
    assert result.units["force"] == "N"
    assert np.array_equal(result["j2.q"], [1.0, 2.0, 3.0])
    assert "force" in result
    assert "nothing" not in result
    assert len(result) == 3


def test_the_data_cannot_be_changed(result):
    with pytest.raises(ValueError, match="read-only"):
        result["j1.q"][0] = 3.0
    with pytest.raises(TypeError):
        result.units["x"] = "m"


def test_a_copy_through_pickle_is_equal_but_for_the_system(result):
    whole = dataclasses.replace(result, system="four_bar", events=((0.5, "stop", "closes"),))
    assert whole.system == "four_bar"
    assert "four_bar" not in repr(whole)
    copy = pickle.loads(pickle.dumps(whole))
    assert copy.system is None
    assert np.array_equal(copy.values, whole.values)
    assert np.array_equal(copy.time, whole.time)
    for name in ("units", "info", "events", "name"):
        assert getattr(copy, name) == getattr(whole, name)
    with pytest.raises(TypeError):
        copy.units["x"] = "m"


def test_the_callers_array_is_copied():
    values = np.zeros((2, 1))
    result = Result(np.array([0.0, 1.0]), values, {"a": "m"})
    values[0, 0] = 5.0
    assert result["a"][0] == 0.0


def test_unknown_name_lists_the_names(result):
    with pytest.raises(ModelError, match=r"no signal 'j3\.q'; it has j1\.q, j2\.q, force"):
        result["j3.q"]


def test_shapes_must_fit():
    with pytest.raises(ModelError, match="number of names"):
        Result(np.zeros(2), np.zeros((2, 2)), {"a": "m"})
    with pytest.raises(ModelError, match="backwards"):
        Result(np.array([1.0, 0.0]), np.zeros((2, 1)), {"a": "m"})


def test_at_is_linear(result):
    assert result.at(0.25) == pytest.approx({"j1.q": 0.05, "j2.q": 1.5, "force": 7.5})
    with pytest.raises(ModelError, match=r"2 s is outside the result, which covers 0 to 1 s"):
        result.at(2.0)


def test_csv_reads_back_bit_for_bit(result, tmp_path):
    path = tmp_path / "r.csv"
    result.to_csv(path)
    with path.open() as stream:
        rows = list(csv.reader(stream))
    assert rows[0] == ["time", "j1.q", "j2.q", "force"]
    back = np.array(rows[1:], dtype=float)
    assert np.array_equal(back[:, 0], result.time)
    assert np.array_equal(back[:, 1:], result.values)


def test_csv_in_a_missing_folder_leaves_nothing(result, tmp_path):
    with pytest.raises(ExportError, match="cannot be written"):
        result.to_csv(tmp_path / "no" / "r.csv")
    assert not list(tmp_path.iterdir())


def test_csv_keeps_the_old_file_when_writing_fails(result, tmp_path, monkeypatch):
    path = tmp_path / "r.csv"
    path.write_text("old")

    def refuse(*_):
        raise OSError("disk full")

    monkeypatch.setattr("mbs.result.os.replace", refuse)
    with pytest.raises(ExportError, match="disk full"):
        result.to_csv(path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_structured_arrays_of_fmpy():
    array = np.array(
        [(0.0, 1.0, 2.0), (1.0, 3.0, 4.0)], dtype=[("time", float), ("a", float), ("b", float)]
    )
    result = Result.from_structured(array, {"a": "rad"}, "model")
    assert result.units == {"a": "rad", "b": "1"}
    assert np.array_equal(result["b"], [2.0, 4.0])


def test_plot_has_one_axis_for_each_unit(result, tmp_path):
    figure = result.plot(path=tmp_path / "r.png")
    assert [axis.get_ylabel() for axis in figure.axes] == ["angle [rad]", "force [N]"]
    assert figure.axes[-1].get_xlabel() == "time [s]"
    assert (tmp_path / "r.png").stat().st_size > 1000


def test_plot_of_some_signals(result, tmp_path):
    assert len(result.plot("force", tmp_path / "r.svg").axes) == 1
    with pytest.raises(ModelError, match="no signal"):
        result.plot(["nothing"], tmp_path / "r.svg")
    with pytest.raises(ExportError, match=r"r\.png: the file cannot be written .*; give a \.png"):
        result.plot(path=tmp_path / "no" / "r.png")
    with pytest.raises(ExportError, match=r"picture .*r\.odd could not be written"):
        result.plot(path=tmp_path / "r.odd")
    assert [path.name for path in tmp_path.iterdir()] == ["r.svg"]


@pytest.mark.parametrize("write", [Result.to_csv, lambda r, path: r.plot("force", path)])
def test_a_folder_is_no_file(result, tmp_path, write):
    for path in (tmp_path, f"{tmp_path}/", f"{tmp_path}/new/"):
        with pytest.raises(ExportError, match="is a folder; give the name of a file"):
            write(result, path)
    with pytest.raises(ExportError, match="3 is not a path"):
        write(result, 3)
    assert list(tmp_path.iterdir()) == []
    assert not list(tmp_path.parent.glob("*.png"))


def test_half_a_picture_is_never_left(result, tmp_path, monkeypatch):
    path = tmp_path / "r.png"
    path.write_text("old")

    def torn(_figure, target):
        with open(target, "w") as stream:
            stream.write("half")
        raise OSError("disk full")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", torn)
    with pytest.raises(ExportError, match="disk full"):
        result.plot("force", path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("module", "call", "extra"),
    [
        ("matplotlib", lambda r: r.plot(path="x.png"), "plot"),
        ("pandas", Result.to_pandas, "tables"),
        ("xarray", Result.to_xarray, "tables"),
    ],
)
def test_missing_extras_say_what_to_install(result, monkeypatch, module, call, extra):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ModelError, match=rf"{module} is not installed; .*casadi-mbs\[{extra}\]"):
        call(result)


def test_pandas_and_xarray_when_installed(result):
    pandas = pytest.importorskip("pandas")
    assert isinstance(result.to_pandas(), pandas.DataFrame)
    pytest.importorskip("xarray")
    assert result.to_xarray()["force"].attrs["units"] == "N"


def test_a_saved_result_reads_back_bit_for_bit(result, tmp_path):
    result = dataclasses.replace(result, events=((0.5, "stop", "bounces off"),))
    result.save(tmp_path / "run.npz")
    again = Result.load(tmp_path / "run.npz")
    assert np.array_equal(again.time, result.time)
    assert np.array_equal(again.values, result.values)
    assert (again.units, again.name, again.events) == (result.units, result.name, result.events)


def test_a_file_that_is_no_saved_result(tmp_path):
    (tmp_path / "x.npz").write_text("no archive")
    (tmp_path / "empty.npz").touch()
    np.save(tmp_path / "one.npy", np.zeros(3))
    for name in ("x.npz", "absent.npz", "empty.npz", "one.npy"):
        with pytest.raises(ModelError, match="is no saved result"):
            Result.load(tmp_path / name)


def test_a_file_with_objects_is_refused(tmp_path):
    """Unpickling one would run whatever its author wrote."""
    path = tmp_path / "result.npz"
    np.savez(path, rest=np.array([{"units": {}}], dtype=object), time=[0.0], values=[[0.0]])
    with pytest.raises(ModelError, match="is no saved result"):
        Result.load(path)
