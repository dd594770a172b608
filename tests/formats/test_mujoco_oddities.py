"""MJCF files as people write them: what was refused before is read, equal to MuJoCo, with notes."""

import random

import numpy as np
import pytest
from formats.test_mujoco_spec import LOOP, TREE, Twin, assert_equal_motion
from support.xml_mutants import mutated

import mbs
from mbs import MbsError
from mbs.components import FixedTendon, Force, Free, Rod, Spherical, Spring
from mbs.errors import DescriptionError
from mbs.expressions import to_float
from mbs.formats import read_mjcf

mujoco = pytest.importorskip("mujoco")


@pytest.fixture
def read(tmp_path):
    def write_and_read(text, **options):
        path = tmp_path / "model.xml"
        path.write_text(text, encoding="utf-8")
        return read_mjcf(path, **options)

    return write_and_read


def notes_of(mechanism, kind=None):
    return [str(note) for note in mechanism.notes if kind in (None, note.kind)]


def assert_same(mechanism, text):
    """The whole mechanism moves as MuJoCo's model of the same text."""
    system = mechanism.assemble()
    assert_equal_motion(Twin(system, mujoco.MjModel.from_xml_string(text)))


ARM = """<mujoco><compiler angle="radian"/>{head}<worldbody>{world}
  <body name="a" pos="0 0 1"><joint name="j1" axis="0 1 0"/>
    <geom type="capsule" size=".03" fromto="0 0 0 .4 0 0"/><site name="s1" pos=".1 0 0"/>
    <body name="b" pos=".4 0 0"><joint name="j2" axis="0 1 0" ref="0.1"/>
      <geom type="capsule" size=".03" fromto="0 0 0 .3 0 0.1"/><site name="s2" pos=".1 0 .1"/>
      <body name="c" pos=".3 0 .1"><joint name="j3" type="slide" axis="1 0 0"/>
        <geom size=".05"/></body></body></body>
</worldbody>{more}</mujoco>"""


def arm(more="", world="", head=""):
    return ARM.format(more=more, world=world, head=head)


# Where a motion starts.


KEYS = """<keyframe><key qpos="0.1 0.2 0.3"/><key name="other" qpos="1 1 1"/>
<key name="Home" qpos="0.4 0.5 0.6"/></keyframe>"""


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        (KEYS, [0.4, 0.5, 0.6]),
        (KEYS.replace("Home", "far"), [0.1, 0.2, 0.3]),
        ("", [0, 0.1, 0]),
    ],
)
def test_a_tree_starts_at_home_at_the_first_key_or_as_it_is_drawn(read, keys, expected):
    system = read(arm(keys)).assemble()
    np.testing.assert_array_equal(system.configuration, expected)


def test_free_bodies_and_balls_start_where_they_are_drawn(read):
    text = """<mujoco><worldbody><body name="f" pos="1 2 3" euler="10 20 30"><freejoint name="j"/>
      <geom size=".1"/><body name="b" pos="0 0 .2" euler="40 0 0"><joint name="ball" type="ball"/>
      <geom size=".1"/></body></body></worldbody></mujoco>"""
    system = read(text).assemble()
    model = mujoco.MjModel.from_xml_string(text)
    np.testing.assert_allclose(system.configuration, model.qpos0, atol=1e-15)
    assert abs(system.configuration[3]) < 0.99


SPRUNG = """<mujoco><compiler angle="radian"/><worldbody>
  <body name="thigh" pos="0 0 1"><joint name="hip" axis="0 1 0"/>
    <geom type="capsule" size=".03" fromto="0 0 0 .3 0 0"/>
    <body name="rod" pos="0 0 -.05"><joint name="ball" type="ball" damping=".01"/>
      <geom type="capsule" size=".01" fromto="0 0 0 .5 0 0"/></body>
    <body name="shin" pos=".3 0 0"><joint name="knee" axis="0 1 0" stiffness="900"/>
      <geom type="capsule" size=".03" fromto="0 0 0 .2 0 0"/>
      <body name="foot" pos=".2 0 0"><joint name="ankle" axis="0 1 0" ref="1"/>
        <geom type="capsule" size=".03" fromto="0 0 0 0 0 .2"/></body></body></body>
</worldbody>
<equality><connect name="close" site1="rod_end" site2="heel"/></equality>
<actuator><motor name="m" joint="ankle" gear="9" ctrlrange="-2 2"/></actuator>
{keys}</mujoco>"""
SPRUNG = SPRUNG.replace(
    'fromto="0 0 0 .5 0 0"/>', 'fromto="0 0 0 .5 0 0"/><site name="rod_end" pos=".5 0 0"/>'
).replace('fromto="0 0 0 0 0 .2"/>', 'fromto="0 0 0 0 0 .2"/><site name="heel" pos="0 0 -.04"/>')


def test_a_leg_with_springs_starts_at_the_keyframe_that_closes_it(read):
    """Springs at rest: what any solver finds from qpos0 bends them, since that leaves it open."""
    plain = read(SPRUNG.format(keys="")).assemble()
    closed = mbs.loops.solve(plain, {"knee": 0.0, "hip": 0.2}, guess={"ankle": 0.8})
    key = " ".join(f"{x:.4f}" for x in closed)
    text = SPRUNG.format(keys=f'<keyframe><key name="home" qpos="{key}"/></keyframe>')
    mechanism = read(text)
    assert mechanism.guess["hip"] == 0.2
    system = mechanism.assemble()
    # four digits of the key, and the nearest configuration that closes the loop
    np.testing.assert_allclose(system.configuration, closed, atol=3e-4)
    knee = [c.name for c in system.coordinates].index("knee")
    assert abs(system.configuration[knee]) < 3e-4
    assert system.closure.residual < 1e-12
    a = np.array(mbs.models.direct_dynamics(system, coordinates="tree")(closed, 0, 0)[0])
    assert np.all(np.isfinite(a))


def test_a_key_that_leaves_the_loop_open_is_passed_over(read):
    plain = read(SPRUNG.format(keys="")).assemble()
    closed = mbs.loops.solve(plain, {"knee": 0.0, "hip": 0.2}, guess={"ankle": 0.8})
    far = "9 " + " ".join(["1", "0", "0", "0"]) + " 0 3"
    key = " ".join(f"{x:.5f}" for x in closed)
    keys = f'<keyframe><key name="home" qpos="{far}"/><key qpos="{key}"/></keyframe>'
    # the candidates are home and the first key, which is the same one here
    first = f'<keyframe><key qpos="{key}"/><key name="home" qpos="{far}"/></keyframe>'
    assert read(SPRUNG.format(keys=first)).guess["hip"] == pytest.approx(0.2)
    assert read(SPRUNG.format(keys=keys)).guess["hip"] == 0


# Equalities.


def test_a_lock_welds_the_joint_where_it_locks_it(read):
    text = arm('<equality><joint name="e" joint1="j2" polycoef="0.3"/></equality>')
    mechanism = read(text)
    assert [joint.name for joint in mechanism.joints()] == ["j1", "j3"]
    assert notes_of(mechanism, "ignored") == [
        "joint 'j2': an equality locks it at 0.4; its two bodies are welded together there"
    ]
    system = mechanism.assemble()
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = 0.7, 0.4, 0.05
    mujoco.mj_forward(model, data)
    equality = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    np.testing.assert_allclose(data.efc_pos[equality], 0, atol=1e-15)
    T = np.array(mbs.models.transform(system, "c")([0.7, 0.05]))
    np.testing.assert_allclose(T[:3, 3], data.body("c").xpos, atol=1e-14)


def test_what_a_locked_joint_leads_is_locked_too(read):
    text = arm(
        '<equality><joint joint1="j1" polycoef="0.2"/>'
        '<joint joint1="j2" joint2="j1" polycoef="0 2 1"/></equality>'
    )
    mechanism = read(text)
    assert [joint.name for joint in mechanism.joints()] == ["j3"]
    # about the positions that are drawn: 0.1 + 2 0.2 + 0.2^2
    assert "joint 'j2': an equality locks it at 0.54" in notes_of(mechanism)[1]


TENDONS = """<tendon>
  <fixed name="t"><joint joint="j1" coef="2"/><joint joint="j2" coef="-1"/>
    <joint joint="j3" coef="0.5"/></fixed>
  <fixed name="u"><joint joint="j3" coef="4"/></fixed></tendon>
<equality><tendon name="e" tendon1="t" {}/></equality>"""


@pytest.mark.parametrize("given", ['polycoef="0.1"', 'tendon2="u" polycoef="0.1 0.3"'])
def test_an_equality_of_fixed_tendons_couples_all_their_joints(read, given):
    text = arm(TENDONS.format(given))
    system = read(text).assemble()
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    assert system.closure.mobility == 2
    for k in range(4):
        q = mbs.loops.solve(system, {"j2": 0.1 * k})
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        equality = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        np.testing.assert_allclose(data.efc_pos[equality], 0, atol=1e-12)
    v = np.linalg.svd(np.array(data.efc_J).reshape(-1, 3)[equality])[2][1:].T
    tau = np.array([1.0, 2.0, 3.0])
    a = np.array(mbs.models.direct_dynamics(system, coordinates="tree")(q, 0, tau)[0]).ravel()
    data.qvel[:], data.qacc[:] = 0, a
    model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    mujoco.mj_inverse(model, data)
    # what is left is a force of the constraint
    np.testing.assert_allclose(v.T @ (data.qfrc_inverse - tau), 0, atol=1e-12)


def test_a_tendon_of_constant_length_between_two_sites_is_a_rod(read):
    text = arm(
        '<tendon><spatial name="t"><site site="o"/><site site="s2"/></spatial></tendon>'
        '<equality><tendon name="e" tendon1="t" polycoef="0.05"/></equality>',
        world='<site name="o" pos="0 0 .2"/>',
    )
    mechanism = read(text)
    rod = mechanism.components["e"]
    assert isinstance(rod, Rod)
    model = mujoco.MjModel.from_xml_string(text)
    assert to_float(rod.length) == pytest.approx(model.tendon_length0[0] + 0.05, abs=1e-15)
    data = mujoco.MjData(model)
    data.qpos[:] = mechanism.assemble().configuration
    mujoco.mj_forward(model, data)
    equality = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    np.testing.assert_allclose(data.efc_pos[equality], 0, atol=1e-9)


def test_a_weld_without_torque_is_a_connect(read):
    text = SPRUNG.format(keys="").replace(
        '<connect name="close" site1="rod_end" site2="heel"/>',
        '<weld name="close" body1="rod" body2="foot" anchor="0 0 -.04"'
        ' relpose="0.5 0 0.04 1 0 0 0" torquescale="{}"/>',
    )
    assert isinstance(read(text.format(0)).components["close"], Spherical)
    assert not isinstance(read(text.format(1)).components["close"], Spherical)


def test_equalities_between_what_never_moves_apart_are_noted(read):
    text = arm(
        '<equality><weld name="e" body1="w1" body2="w2"/><weld name="f" body1="w1"/></equality>',
        world='<body name="w1"/><body name="w2" pos="1 0 0"/>',
    )
    assert notes_of(read(text)) == [
        f"equality {name!r}: it joins two bodies that never move apart" for name in "ef"
    ]
    assert_same(read(text), text)


MOCAP = '<body name="hand" mocap="true" pos="1 0 1"><site name="goal"/></body>'


def test_mocap_bodies_stand_still_and_what_is_welded_to_them_is_free(read):
    text = arm('<equality><weld name="e" body1="hand" body2="b"/></equality>', world=MOCAP)
    mechanism = read(text)
    assert notes_of(mechanism, "ignored") == [
        "body 'hand': it is moved from outside (mocap); here it stands still where it is drawn",
        "equality 'e': it ties a body to 'hand', which is moved from outside (mocap)",
    ]
    assert_same(mechanism, text)
    T = np.array(mbs.models.transform(mechanism.assemble(), "goal")([0, 0, 0]))
    np.testing.assert_array_equal(T[:3, 3], [1, 0, 1])


# Actuators.


def test_a_tendon_drives_all_its_joints(read):
    text = arm(
        '<tendon><fixed name="t"><joint joint="j1" coef="0.5"/><joint joint="j3" coef="-2"/>'
        '</fixed></tendon><actuator><motor name="m" tendon="t" gear="3" forcerange="-1 2"/>'
        "</actuator>"
    )
    mechanism = read(text)
    joints = {joint.name: joint for joint in mechanism.joints()}
    assert [joint.actuated for joint in joints.values()] == [True, False, True]
    assert joints["j1"].effort == (-1.5, 3)
    assert joints["j3"].effort == (-12, 6)
    assert notes_of(mechanism) == [
        "actuator 'm': it drives the joints 'j1', 'j3' together; each of them has an effort of its"
        " own here"
    ]
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.ctrl[:] = 100
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qfrc_actuator, [3, 0, -12])


def test_a_muscle_on_a_path_drives_the_joints_between_its_ends(read):
    text = arm(
        '<tendon><spatial name="t"><site site="s1"/><site site="s2"/></spatial></tendon>'
        '<actuator><muscle name="m" tendon="t" lengthrange="0.1 0.5"/></actuator>'
    )
    mechanism = read(text)
    assert [joint.actuated for joint in mechanism.joints()] == [False, True, False]
    assert len(notes_of(mechanism, "ignored")) == 2
    assert_same(mechanism, text)


def test_forces_on_sites_and_servos_are_noted(read):
    text = arm(
        '<actuator><motor name="thrust" site="s2" gear="0 0 1 0 0 0"/>'
        '<position name="servo" joint="j1" kp="5"/></actuator>'
    )
    mechanism = read(text)
    thrust, servo = notes_of(mechanism)
    assert thrust.startswith("actuator 'thrust': it acts on a site or a body, not on a joint")
    assert servo.startswith("actuator 'servo': its gain, bias and dynamics say how a command")
    assert [joint.actuated for joint in mechanism.joints()] == [True, False, False]


# Forces.


def test_a_tendon_between_two_sites_is_a_spring(read):
    text = arm(
        '<tendon><spatial name="t" stiffness="70" damping="3" springlength="0.1">'
        '<site site="o"/><site site="s2"/></spatial></tendon>',
        world='<site name="o" pos="0 .1 .2"/>',
    )
    mechanism = read(text)
    assert isinstance(mechanism.components["t"], Spring)
    assert_same(mechanism, text)


def test_a_slack_fixed_tendon_over_three_joints(read):
    text = arm(
        '<tendon><fixed name="t" stiffness="70" damping="3" springlength="-0.1 0.2" limited="true"'
        ' range="-3 3"><joint joint="j1" coef="1.5"/><joint joint="j2" coef="-.7"/>'
        '<joint joint="j3" coef="2"/></fixed></tendon>',
    )
    mechanism = read(text)
    assert isinstance(mechanism.components["t"], FixedTendon)
    assert notes_of(mechanism) == ["tendon 't': it has a range, and only joints have limits here"]
    assert_same(mechanism, text)


def test_compensation_by_motors_is_theirs(read):
    text = arm().replace('<body name="c"', '<body name="c" gravcomp="1"')
    assert isinstance(read(text).components["c_gravcomp"], Force)
    assert_same(read(text), text)
    driven = text.replace('<joint name="j', '<joint actuatorgravcomp="true" name="j')
    assert notes_of(read(driven)) == [
        "body 'c': its gravcomp is a part of what its actuators give, the input here"
    ]
    assert_same(read(driven), driven)
    mixed = text.replace('<joint name="j1"', '<joint actuatorgravcomp="true" name="j1"')
    with pytest.raises(DescriptionError, match="by some of its joints' actuators and not by"):
        read(mixed)


# Assets, names, the base, strict reading.


ASSETS = """<mujoco><asset>
  <texture name="t" type="2d" file="nowhere.png"/><material name="steel" texture="t"/>
  <mesh name="m" file="nowhere.obj"/><hfield name="h" file="nowhere.png" size="1 1 1 1"/></asset>
<default><site material="steel"/><default class="v"><geom type="mesh" mesh="m"/></default></default>
<worldbody><site name="o"/><geom type="hfield" hfield="h" material="steel"/>
  <body name="a"><joint name="j"/><inertial pos=".1 0 0" mass="1" diaginertia=".1 .1 .1"/>
    <geom class="v" material="steel"/><geom name="g" type="sphere" size=".05"/><site name="s"/>
  </body></worldbody>
<tendon><spatial name="path" material="steel"><site site="o"/><geom geom="g"/><site site="s"/>
  </spatial></tendon>
<contact><pair geom1="g" geom2="g2"/></contact>
<sensor><framepos name="p" objtype="geom" objname="g"/></sensor></mujoco>"""


def test_missing_assets_go_with_all_that_refers_to_them(read):
    text = ASSETS.replace('<contact><pair geom1="g" geom2="g2"/></contact>', "")
    mechanism = read(text)
    assert set(mechanism.frames) == {"o", "s"}
    (note,) = mechanism.notes  # of the picture alone
    assert note.text.startswith("'nowhere.obj' is not drawn")
    plain = """<mujoco><worldbody><body name="a"><joint name="j"/>
      <inertial pos=".1 0 0" mass="1" diaginertia=".1 .1 .1"/></body></worldbody></mujoco>"""
    assert_same(mechanism, plain)


def test_names_that_collide_are_made_different_and_noted(read):
    text = """<mujoco><worldbody><body name="base"><joint name="a b"/><geom size=".1"/>
      <site name="x"/><body name="x"><joint name="a_b"/><geom size=".1"/>
      <body name="a.b"><joint name="x"/><geom size=".1"/></body></body></body></worldbody>
      </mujoco>"""
    mechanism = read(text)
    assert [joint.name for joint in mechanism.joints()] == ["a_b", "a_b_joint", "x"]
    assert [body.name for body in mechanism.bodies()] == ["base_body", "x_body", "a_b_body"]
    assert list(mechanism.frames) == ["x_site"]
    assert notes_of(mechanism, "renamed") == [
        "joint 'a b': its name here is 'a_b'",
        "joint 'a_b': its name here is 'a_b_joint'",
        "body 'base': its name here is 'base_body'",
        "body 'x': its name here is 'x_body'",
        "body 'a.b': its name here is 'a_b_body'",
        "site 'x': its name here is 'x_site'",
    ]
    with pytest.raises(DescriptionError, match=r"joint 'a b': its name here is 'a_b'; correct the"):
        read(text, strict=True)


def test_bodies_between_joints_leave_the_names_of_the_file_alone(read):
    text = """<mujoco><worldbody><site name="a_j2"/><body name="a" gravcomp="1">
      <joint name="j1"/><joint name="j2" axis="1 0 0"/><joint name="root_joint" axis="0 1 0"/>
      <geom size=".1"/><site name="a_j1"/><site name="a_gravcomp"/></body></worldbody></mujoco>"""
    mechanism = read(text)
    assert mechanism.notes == []
    assert set(mechanism.frames) == {"a_j1", "a_j2", "a_gravcomp"}
    assert [body.name for body in mechanism.bodies()] == ["a", "a_j12", "a_j22"]
    assert "a_gravcomp2" in mechanism.components
    assert_same(mechanism, text)


def test_a_root_is_freed_or_fixed(read):
    text = arm().replace('<body name="a"', '<body name="root" pos="1 2 3"><body name="a"')
    text = text.replace("</worldbody>", '<geom size=".2"/></body></worldbody>')
    free = read(text, base="free")
    assert isinstance(next(iter(free.joints())), Free)
    system = free.assemble()
    np.testing.assert_array_equal(system.configuration[:7], [1, 2, 3, 1, 0, 0, 0])
    theirs = text.replace('pos="1 2 3">', 'pos="1 2 3"><freejoint name="root_joint"/>')
    assert_same(free, theirs)
    fixed = read(theirs, base="fixed")
    assert [joint.name for joint in fixed.joints()] == ["j1", "j2", "j3"]
    assert_same(fixed, text)
    held = theirs.replace("</mujoco>", '<equality><weld body1="root"/></equality></mujoco>')
    assert read(held).assemble().is_closed
    assert not read(held, base="fixed").assemble().is_closed
    with pytest.raises(DescriptionError, match="base is 'floating'; give 'fixed', 'free' or None"):
        read(text, base="floating")


def test_frames_that_mujoco_takes_as_one_are_one(read):
    text = arm().replace(
        '<geom size=".05"/>', '<inertial pos="3e-9 0 0" mass="1" diaginertia=".1 .2 .15"/>'
    )
    model = mujoco.MjModel.from_xml_string(text)
    body = read(text).components["c"]
    assert model.body("c").sameframe == mujoco.mjtSameFrame.mjSAMEFRAME_BODY
    assert [to_float(x) for x in body.com] == [0, 0, 0]


def test_what_mujoco_doubts_is_noted(read):
    text = arm(head='<compiler settotalmass="3"/>')
    mechanism = read(text)
    assert all(note.kind == "doubted" for note in mechanism.notes)
    assert sum(to_float(body.mass) for body in mechanism.bodies()) == pytest.approx(3)


# Mutants: a sentence or a mechanism, whatever stands in the file.


SEEDS = (
    TREE,
    LOOP,
    SPRUNG.format(keys=""),
    ASSETS.replace('<contact><pair geom1="g" geom2="g2"/></contact>', ""),
    arm(TENDONS.format('tendon2="u"') + KEYS, world=MOCAP),
)
LONGEST_SENTENCE = 1000
"""Letters: names of others are quoted in part, and one of MuJoCo's messages is 400 of them."""


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("seed", range(4))
def test_mutants_are_read_or_refused_in_a_sentence(read, seed, capfd):
    rng = random.Random(seed)
    sentences = [_outcome(read, mutated(rng, rng.choice(SEEDS))) for _ in range(75)]
    assert [s for s in sentences if "\n" in s or len(s) > LONGEST_SENTENCE] == []
    assert sentences.count("") > 10


def _outcome(read, text):
    """The sentence in which a file is refused, or its mechanism; empty where it is assembled."""
    try:
        read(text).assemble()
    except MbsError as error:
        return str(error)
    return ""


@pytest.mark.parametrize(
    "copies",
    [
        '<replicate count="100000000"><body><joint/><geom size=".1"/></body></replicate>',
        '<replicate count="200"><replicate count="200"><geom size=".1"/></replicate></replicate>',
        '<body><flexcomp name="f" type="grid" count="100 100 100" spacing=".1 .1 .1"/></body>',
    ],
)
def test_copies_without_end_are_refused_before_they_are_made(read, copies):
    with pytest.raises(DescriptionError, match="copies, and 10000 are the most; write fewer"):
        read(f"<mujoco><worldbody>{copies}</worldbody></mujoco>")


def test_some_copies_are_made(read):
    body = '<body name="b"><joint name="j" axis="0 1 0"/><geom size=".1" pos=".2 0 0"/></body>'
    copies = f'<replicate count="3" offset="1 0 0">{body}</replicate>'
    assert read(f"<mujoco><worldbody>{copies}</worldbody></mujoco>").assemble().nq == 3
