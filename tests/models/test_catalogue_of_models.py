import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.errors import ModelError
from mbs.models.catalogue import entries, entry
from mbs.models.catalogue.configurations import held_at, moving_joints, surplus_joints
from mbs.models.catalogue.entry import regular_part


@pytest.fixture(scope="module")
def systems():
    names = ("rx90", "sr400", "four_bar", "planar_2r", "panda", "scara", "five_bar")
    return {name: catalogue_system(name) for name in names}


def test_keys_are_unique_and_found():
    keys = [one.key for one in entries()]
    assert len(keys) == len(set(keys)) > 20
    assert all(entry(key).key == key for key in keys)
    with pytest.raises(ModelError, match="there is no model 'jacobien'; did you mean 'jacobian'"):
        entry("jacobien")


REGULAR = [
    ("rx90", 6, "Vx Vy Vz wx wy wz", "q1 q2 q3 q4 q5 q6"),
    ("rx90", 3, "Vx Vy wx", "q1 q2 q3"),
    ("planar_2r", 2, "Vx wz", "q1 q2"),
    ("panda", 7, "Vx Vy Vz wx wy wz", "q1 q2 q3 q4 q5 q6"),
    ("scara", 4, "Vx Vy Vz wz", "q1 q2 q3 q4"),
    ("four_bar", 3, "wz", "j1"),
    ("five_bar", "tool", "Vx Vy", "q1 q3"),
    ("sr400", 6, "Vx Vy Vz wx wy wz", "q1 q2 q4 q5 q6 q7"),
]


@pytest.mark.parametrize(("name", "frame", "rows", "columns"), REGULAR)
def test_the_default_part_of_a_jacobian_has_an_inverse(systems, name, frame, rows, columns):
    system = systems[name]
    chosen = entry("inverse-jacobian").choices(system, frame=frame)
    assert (chosen["rows"], chosen["columns"]) == (tuple(rows.split()), tuple(columns.split()))
    inverse = entry("inverse-jacobian").build(system, frame=frame)
    q = np.array(system.configuration)
    if not system.is_closed:
        q = np.random.default_rng(3).uniform(0.3, 1.0, system.nq)
    elif name == "sr400":
        q = mbs.loops.solve(system, {"q4": 0.4, "q5": 0.7})
    J = np.array(mbs.models.jacobian(system, frame)(q)).reshape(6, -1)
    names = [system.velocity_coordinates[k].name for k in system.independent]
    kept = np.ix_(
        [("Vx", "Vy", "Vz", "wx", "wy", "wz").index(row) for row in rows.split()],
        [names.index(column) for column in columns.split()],
    )
    size = len(rows.split())
    assert np.allclose(np.array(inverse(q)).reshape(size, size) @ J[kept], np.eye(size))


def test_what_is_given_stays_and_the_rest_follows(systems):
    of = (6, 0, "independent")
    assert regular_part(systems["rx90"], of, ["Vz", "wz"]) == (("Vz", "wz"), ("q1", "q2"))
    assert regular_part(systems["rx90"], of, None, ["q4", "q5"]) == (("wx", "wy"), ("q4", "q5"))
    assert regular_part(systems["rx90"], (0, 0, "independent")) == ((), ())
    tree = regular_part(systems["four_bar"], (2, 0, "tree"))
    assert tree == (("Vx", "wz"), ("j1", "j2"))


def test_lengths_in_other_units_change_nothing():
    def arm(length):
        frames = [{"antecedent": 0}, {"antecedent": 1, "d": length}, {"antecedent": 2, "d": length}]
        return mbs.load({"name": "arm", "frame": frames}).assemble()

    parts = {regular_part(arm(length), (3, 0, "independent")) for length in (1e-4, 1.0, 1e4)}
    assert parts == {(("Vx", "Vy", "wz"), ("q1", "q2", "q3"))}


def test_a_refusal_says_why(systems):
    assert entry("idm").refusal(systems["rx90"]) == ""
    assert entry("closure").refusal(systems["rx90"]).endswith("closed loops; rx90 has none")
    assert "four_bar has 2 at most" in entry("igm-pieper").refusal(systems["four_bar"])
    assert entry("igm-pieper").applies(systems["sr400"])
    delta = catalogue_system("delta")
    assert "solved by iteration" in entry("dgm").refusal(delta)
    assert entry("dgm").refusal(systems["four_bar"]) == ""
    assert "delta has 1 at most" in entry("igm-pieper").refusal(delta)
    for one in entries():
        for system in systems.values():
            assert one.applies(system) == (not one.refusal(system))


def test_a_model_without_function_says_so(systems):
    with pytest.raises(ModelError, match="is no Function; ask for its text or configurations"):
        entry("igm-paul").build(systems["sr400"])
    assert not entry("igm-general").has_function(systems["scara"])
    assert entry("igm-general").has_function(systems["rx90"])


def test_options_must_be_offered(systems):
    with pytest.raises(ModelError, match="frame 9 is not offered"):
        entry("jacobian").choices(systems["rx90"], frame=9)
    with pytest.raises(ModelError, match="columns 'j2' is not offered"):
        entry("determinant").choices(systems["four_bar"], columns=("j2",))
    chosen = entry("determinant").choices(
        systems["four_bar"], coordinates="tree", rows=("wz",), columns=("j2",), frame=2
    )
    assert chosen["columns"] == ("j2",)
    assert entry("determinant").choices(systems["four_bar"], rows=None)["rows"] == ("wz",)


def test_joints_of_a_chain(systems):
    panda = systems["panda"]
    assert moving_joints(panda, 4) == ("q1", "q2", "q3", "q4")
    assert surplus_joints(panda, 7) == ("q3",)
    assert surplus_joints(panda, 6) == ()
    assert moving_joints(catalogue_system("stewart_platform"), "centre") == ()
    assert held_at(panda, ("q3",), range(7)) == {"q3": 2.0}


def test_the_general_method_in_words(systems):
    general = entry("igm-general")
    text = general.text(systems["rx90"], **general.choices(systems["rx90"]))
    assert "q3 from det(M0(T) + M1(T) cos(q3) + M2(T) sin(q3)) = 0" in text
    text = general.text(systems["scara"], **general.choices(systems["scara"]))
    assert "The method is for six joints, here are 4" in text
    text = general.text(systems["panda"], **general.choices(systems["panda"]))
    assert "joints: q1, q2, q4, q5, q6, q7" in text
