"""Equations as text, with their counts: every model of the menus on robots of every structure."""

import pickle

import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.app.tasks.equations import (
    EVERY_PASS,
    MENUS,
    entries,
    entry,
    equations,
    languages,
    option_values,
    parsed_options,
)
from mbs.errors import ModelError, NoClosedForm
from mbs.export import code
from mbs.export.languages import LANGUAGES, language_of
from mbs.models import inverse_dynamics
from mbs.operations import count, simplify

SYMBOLIC = {
    "name": "symbolic arm",
    "gravity": [0, 0, "-G3"],
    "parameters": {"G3": 9.81, "D3": 0.45, "RL4": 0.4},
    "frame": [
        {"antecedent": 0},
        {"antecedent": 1, "alpha": "-pi/2"},
        {"antecedent": 2, "d": "D3"},
        {"antecedent": 3, "alpha": "pi/2", "r": "RL4"},
        {"antecedent": 4, "alpha": "-pi/2"},
        {"antecedent": 5, "alpha": "pi/2"},
    ],
    "body": [{"frame": k, "ZZ": f"ZZ{k}", "MX": f"MX{k}", "M": f"M{k}"} for k in range(1, 7)],
}
NAMES = ("rx90", "sr400", "four_bar", "two_branch_tree", "symbolic arm")
TABLE_1 = {
    "Geometric": "transform dgm igm-pieper igm-paul igm-general closure",
    "Kinematic": "jacobian inverse-jacobian determinant velocities accelerations jpqp"
    " velocity-closure acceleration-closure",
    "Dynamic": "idm lagrange inertia bias ddm",
    "Identification": "base-parameters dynamic-identification energy-identification"
    " filtered-identification",
}
BY_WORDS = {("base-parameters", name) for name in NAMES if name != "rx90"}
"""Found anew at every call, which takes seconds; the text of one robot is enough."""
LONG = {(key, name) for key in ("didm", "dddm") for name in NAMES[1:] if name != "four_bar"}
"""Derivatives of thousands of operations; those of two robots are enough."""
LIGHT = ("jacobian", "determinant", "inertia", "gravity", "jpqp")


@pytest.fixture(scope="module")
def systems():
    return {name: mbs.load(SYMBOLIC if " " in name else name).assemble() for name in NAMES}


@pytest.mark.sweep
@pytest.mark.parametrize(
    ("key", "name"),
    [(one.key, name) for one in entries() for name in NAMES if (one.key, name) not in LONG],
)
def test_every_entry_is_written(systems, key, name):
    system, one = systems[name], entry(key)
    if one.refusal(system):
        with pytest.raises(ModelError, match="for "):
            equations(system, key)
        return
    offered = languages(one, system)
    assert offered
    if "words" in offered:
        assert len(equations(system, key, language="words").text) > 20
    if "c" not in offered or (key, name) in BY_WORDS:
        return
    made = equations(system, key, language="c", passes=())
    built = one.build(system)
    assert made.before == made.after == count(built)
    assert made.before.parameter_only == count(built).parameter_only
    assert made.steps == ()
    assert f"void {built.name()}(" in made.text
    assert made.text.rstrip().endswith("}")


def test_the_symbols_of_the_arm_are_in_its_text(systems):
    made = equations(systems["symbolic arm"], "idm", language="c", passes=())
    assert made.inputs == ("q (6, 1)", "v (6, 1)", "a (6, 1)", "p (21, 1)")
    assert "RL4" in made.text
    assert "ZZ6" in made.text
    assert made.before.parameter_only.total > 0


@pytest.mark.parametrize("name", ["four_bar", "two_branch_tree"])
@pytest.mark.parametrize("key", LIGHT)
def test_the_optimizer_never_adds_and_counts_what_it_writes(systems, name, key):
    made = equations(systems[name], key, language="c")
    built = entry(key).build(systems[name])
    final = simplify(built)
    assert (made.before, made.after) == (count(built), count(final))
    assert made.after.total <= made.before.total
    assert made.text == code(final, "c")
    assert {step.name for step in made.steps} == set(EVERY_PASS)


def test_the_c_text_is_what_the_export_writes(systems):
    idm = inverse_dynamics(systems["rx90"])
    plain = equations(systems["rx90"], "idm", language="c", passes=())
    assert plain.text == code(idm, "c")
    assert plain.file_name == "rx90_idm.c"
    made = equations(systems["rx90"], "idm", language="c")
    assert made.text == code(simplify(idm), "c")
    assert made.after.total < made.before.total
    chosen = equations(systems["rx90"], "idm", language="c", passes=("drop", "fold"))
    assert chosen.text == code(simplify(idm, ("drop", "fold")), "c")


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_language(systems, language):
    made = equations(systems["four_bar"], "gravity", language=language, passes=())
    assert made.text == code(entry("gravity").build(systems["four_bar"]), language)
    assert made.file_name == f"four_bar_gravity{made.suffix}"
    assert made.suffix == language_of(language).suffix


def test_endings_of_files_are_those_of_the_languages(systems):
    endings = {name: language_of(name).suffix for name in LANGUAGES}
    assert endings["fortran"] == ".f90"
    assert endings["octave"] == endings["matlab"] == ".m"
    assert len(set(endings.values())) == len(endings) - 1
    assert equations(systems["rx90"], "igm-pieper", language="words").suffix == ".txt"


def test_the_words_of_a_closed_form_name_its_joints(systems):
    text = equations(systems["rx90"], "igm-pieper", language="words").text
    assert "branches: 8" in text
    sheet = equations(systems["sr400"], "igm-paul").text
    assert "Inverse geometric model of sr400: q1, q2, q3, q4, q5, q6" in sheet
    with pytest.raises(NoClosedForm, match="no closed form gives"):
        equations(catalogue_system("panda"), "igm-paul", language="words")


def test_entries_stand_in_the_menus_of_table_1():
    for menu, keys in TABLE_1.items():
        assert set(keys.split()) <= {one.key for one in entries() if one.menu == menu}
    assert {one.menu for one in entries()} == set(MENUS)


def test_results_travel_between_processes(systems):
    made = equations(systems["four_bar"], "idm", {"coordinates": "tree"}, "fortran")
    assert pickle.loads(pickle.dumps(made)) == made
    assert dict(made.choices)["coordinates"] == "tree"


def test_refusals_name_the_model_and_what_is_offered(systems):
    with pytest.raises(ModelError, match="did you mean 'idm'"):
        equations(systems["rx90"], "idmm")
    with pytest.raises(ModelError, match="not written in 'cobol'"):
        equations(systems["rx90"], "idm", language="cobol")
    with pytest.raises(ModelError, match="there is no pass 'shorten'"):
        equations(systems["rx90"], "idm", passes=("shorten",))
    with pytest.raises(ModelError, match="for mechanisms with closed loops; rx90 has none"):
        equations(systems["rx90"], "closure")
    with pytest.raises(ModelError, match="four_bar has 2 at most"):
        equations(systems["four_bar"], "igm-pieper")
    with pytest.raises(ModelError, match="igm-paul of sr400 is not written in 'c'"):
        equations(systems["sr400"], "igm-paul", language="c")


def test_options_are_read_from_texts(systems):
    rx90 = systems["rx90"]
    one = entry("inverse-jacobian")
    values = parsed_options(rx90, one, {"frame": "4", "rows": "Vx, Vy,Vz", "columns": "q1,q2,q3"})
    assert values == {"frame": 4, "rows": ("Vx", "Vy", "Vz"), "columns": ("q1", "q2", "q3")}
    made = equations(rx90, "inverse-jacobian", values, passes=())
    assert made.outputs == ("J_inv (3, 3)",)
    assert parsed_options(rx90, entry("idm"), {"f_ext": "yes"}) == {"f_ext": True}
    for texts, sentence in (
        ({"frame": "9"}, "frame '9' is not offered"),
        ({"rows": "Vx,up"}, "rows 'up' is not offered"),
        ({"colour": "red"}, "there is no option 'colour'"),
    ):
        with pytest.raises(ModelError, match=sentence):
            parsed_options(rx90, one, texts)
    with pytest.raises(ModelError, match="write yes or no"):
        parsed_options(rx90, entry("idm"), {"f_ext": "perhaps"})


def test_rows_of_a_form_follow_from_the_frame(systems):
    def chosen(name, key="determinant", **given):
        rows = option_values(systems[name], entry(key), given)
        return {row.name: row.chosen for row in rows}

    assert chosen("four_bar")["rows"] == ("wz",)
    assert chosen("four_bar", coordinates="tree", frame=2)["rows"] == ("Vx", "wz")
    assert chosen("rx90", frame=3)["rows"] == ("Vx", "Vy", "wx")
    assert chosen("rx90", frame=3)["columns"] == ("q1", "q2", "q3")
    assert "coordinates" not in chosen("rx90")
    assert chosen("two_branch_tree")["columns"] == ("q1", "q5", "q6", "q7")
    assert "expressed_in" not in chosen("rx90", "idm")
