"""Flags of MJCF files: each has its effect on the equations, or none, as in MuJoCo."""

import numpy as np
import pytest

import mbs
from mbs.errors import DescriptionError
from mbs.expressions import to_float
from mbs.formats import read_mjcf
from mbs.formats.mjcf.reader import _EFFECTIVE, _ENABLED_WITHOUT_EFFECT, _WITHOUT_EFFECT, Flags

mujoco = pytest.importorskip("mujoco")

ONE_FLAG = hasattr(mujoco.mjtDisableBit, "mjDSBL_PASSIVE")
"""Whether springs and dampers still have one flag together."""
NO_SPRINGS = "" if ONE_FLAG else 'spring="disable"'
NO_DAMPERS = "" if ONE_FLAG else 'damper="disable"'
NOTHING_PASSIVE = 'passive="disable"' if ONE_FLAG else f"{NO_SPRINGS} {NO_DAMPERS}"
two_flags = pytest.mark.skipif(ONE_FLAG, reason="this MuJoCo has one flag for both")

MODEL = """<mujoco><compiler angle="radian"/>
<option gravity="0.5 0.2 -9.7" {option}><flag {flags}/></option>
<worldbody>
  <body name="a" pos="0 0 1" {body}>
    <joint name="j1" axis="1 2 0" stiffness="{k}" springref="0.6" damping="{c}" armature=".1"
      {joint}/>
    <inertial pos=".1 .05 .2" mass="2" diaginertia=".1 .12 .08"/>
    <geom type="box" size=".1 .2 .3"/>
    <body name="b" pos=".3 0 0">
      <joint name="j2" type="slide" axis="0 1 1" stiffness="{k}" springref="-.1" damping="{c}"
        {joint}/>
      <inertial pos="0 .1 0" mass="1" diaginertia=".02 .03 .04"/>
      <geom type="box" size=".1 .1 .1"/>
      <body name="c" pos="0 .2 0"><joint name="j3" type="{third}" {ball}/>
        <inertial pos=".1 0 0" mass="1" diaginertia=".02 .03 .04"/></body>
    </body>
  </body>
</worldbody>{more}
</mujoco>"""
PLAIN = {
    "option": "",
    "flags": "",
    "body": "",
    "joint": "",
    "ball": "",
    "third": "hinge",
    "more": "",
}


def text_of(**changes):
    """The model with springs of 30 and dampers of 2, unless other words are given."""
    return MODEL.format(**{**PLAIN, "k": 30, "c": 2, **changes})


def read(tmp_path, text):
    path = tmp_path / "model.xml"
    path.write_text(text, encoding="utf-8")
    return read_mjcf(path)


def differences(mechanism, text, seed=0):
    """Largest differences of efforts and accelerations from mj_inverse and mj_forward, relative."""
    system = mechanism.assemble()
    model = mujoco.MjModel.from_xml_string(text)
    assert system.nq == model.nq
    idm = mbs.models.inverse_dynamics(system)
    ddm = mbs.models.direct_dynamics(system)
    rng = np.random.default_rng(seed)
    worst = [0.0, 0.0]
    for _ in range(4):
        data = mujoco.MjData(model)
        data.qpos[:] = rng.uniform(-0.7, 0.7, model.nq)
        mujoco.mj_normalizeQuat(model, data.qpos)
        data.qvel[:], data.qacc[:] = rng.uniform(-1, 1, (2, model.nv))
        q, v, a = (np.array(x) for x in (data.qpos, data.qvel, data.qacc))
        mujoco.mj_inverse(model, data)
        theirs, ours = np.array(data.qfrc_inverse), np.array(idm(q, v, a)).ravel()
        worst[0] = max(worst[0], np.abs(theirs - ours).max() / np.abs(theirs).max())
        tau = rng.uniform(-3, 3, model.nv)
        data.qfrc_applied[:], data.ctrl[:] = tau, 5.0
        mujoco.mj_forward(model, data)
        theirs, ours = np.array(data.qacc), np.array(ddm(q, v, tau)).ravel()
        worst[1] = max(worst[1], np.abs(theirs - ours).max() / np.abs(theirs).max())
    return worst


def equal(mechanism, text):
    """Whether both codes agree to rounding."""
    # 1e-10: rounding of three like links; any flag that is ignored changes the fourth digit.
    return max(differences(mechanism, text)) < 1e-10


@pytest.mark.parametrize(
    "flags",
    [
        "",
        pytest.param(NO_SPRINGS, marks=two_flags),
        pytest.param(NO_DAMPERS, marks=two_flags),
        NOTHING_PASSIVE,
        'gravity="disable"',
        f'gravity="disable" {NOTHING_PASSIVE}',
        'constraint="disable"',
    ],
)
def test_springs_dampers_and_gravity(tmp_path, flags):
    text = text_of(flags=flags)
    mechanism = read(tmp_path, text)
    assert equal(mechanism, text)
    stiff, damped = (
        not (NO_SPRINGS and NO_SPRINGS in flags),
        not (NO_DAMPERS and NO_DAMPERS in flags),
    )
    if NOTHING_PASSIVE in flags:
        stiff = damped = False
    for joint in mechanism.joints():
        if joint.name != "j3":
            assert (to_float(joint.stiffness) or 0) == 30 * stiff
            assert to_float(joint.Fv) == 2 * damped


def test_the_flags_change_the_efforts_by_much(tmp_path):
    """What is asserted above would fail for the same file without flags."""
    plain = text_of()
    for flags in (NOTHING_PASSIVE, 'gravity="disable"'):
        assert differences(read(tmp_path, plain), text_of(flags=flags))[0] > 0.1


@pytest.mark.parametrize("flags", ['frictionloss="disable"', 'constraint="disable"'])
def test_coulomb_friction_is_a_constraint(tmp_path, flags):
    text = text_of(joint='frictionloss="0.7"', flags=flags)
    assert equal(read(tmp_path, text), text)
    acting = read(tmp_path, text_of(joint='frictionloss="0.7"'))
    assert [to_float(joint.Fs) for joint in acting.joints()] == [0.7, 0.7, 0]


@pytest.mark.parametrize("flags", ['limit="disable"', 'constraint="disable"'])
def test_ranges_of_joints(tmp_path, flags):
    """Positions are outside of the range: MuJoCo would push the joints back."""
    ranged = 'range="-0.01 0.01" limited="true"'
    text = text_of(joint=ranged, flags=flags)
    mechanism = read(tmp_path, text)
    assert equal(mechanism, text)
    assert [coordinate.limits for coordinate in mechanism.assemble().coordinates] == [None] * 3
    acting = read(tmp_path, text_of(joint=ranged)).assemble()
    assert [coordinate.limits for coordinate in acting.coordinates[:2]] == [(-0.01, 0.01)] * 2


LOOP = """<mujoco><option><flag {flags}/></option><worldbody>
  <body name="a"><joint name="ja" axis="0 1 0"/>
    <geom type="capsule" size=".03" fromto="0 0 0 0 0 .4"/>
    <body name="b" pos="0 0 .4"><joint name="jb" axis="0 1 0"/>
      <geom type="capsule" size=".03" fromto="0 0 0 1 0 0.2"/></body></body>
  <body name="c" pos=".8 0 0"><joint name="jc" axis="0 1 0"/>
    <geom type="capsule" size=".03" fromto="0 0 0 0.1 0 .9"/></body>
</worldbody><contact><exclude body1="a" body2="b"/><exclude body1="b" body2="c"/></contact>
<equality><connect name="close" body1="b" body2="c" anchor="1 0 .2"/></equality></mujoco>"""


@pytest.mark.parametrize("flags", ['equality="disable"', 'constraint="disable"'])
def test_loops_that_are_switched_off(tmp_path, flags):
    assert read(tmp_path, LOOP.format(flags="")).assemble().is_closed
    text = LOOP.format(flags=f'{flags} contact="disable"')
    mechanism = read(tmp_path, text)
    assert not mechanism.assemble().is_closed
    assert equal(mechanism, text)


MOTORS = """<actuator>
  <motor name="m1" joint="j1" gear="3" ctrlrange="-1 1" ctrllimited="true" group="1"/>
  <motor name="m2" joint="j2" gear="2" forcerange="-4 4" forcelimited="true" group="2"/>
</actuator>"""


@pytest.mark.parametrize(
    ("flags", "groups", "actuated", "efforts"),
    [
        ("", "", [True, True, False], [(-3, 3), (-8, 8), None]),
        ('clampctrl="disable"', "", [True, True, False], [None, (-8, 8), None]),
        ('actuation="disable"', "", [False, False, False], [None, None, None]),
        ("", 'actuatorgroupdisable="1"', [False, True, False], [None, (-8, 8), None]),
        ("", 'actuatorgroupdisable="0 2"', [True, False, False], [(-3, 3), None, None]),
    ],
)
def test_actuators_and_what_they_can_give(tmp_path, flags, groups, actuated, efforts):
    text = text_of(flags=flags, option=groups, more=MOTORS)
    mechanism = read(tmp_path, text)
    assert [joint.actuated for joint in mechanism.joints()] == actuated
    assert [speed.effort for speed in mechanism.assemble().velocity_coordinates] == efforts
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.ctrl[:] = 100.0
    mujoco.mj_forward(model, data)
    given = zip(actuated, efforts, data.qfrc_actuator, strict=True)
    for drives, effort, force in given:
        if not drives:
            assert force == 0
        elif effort is not None:
            assert force == pytest.approx(effort[1])
        else:
            assert force == pytest.approx(300)


REFUSED = [
    ({"option": 'density="1000" viscosity="3"'}, NOTHING_PASSIVE, "the medium"),
    ({"third": "ball", "ball": 'stiffness="3"'}, NO_SPRINGS or NOTHING_PASSIVE, "has a spring"),
]


@pytest.mark.parametrize(("changes", "flags", "refusal"), REFUSED)
def test_what_would_be_refused_is_read_where_it_is_switched_off(tmp_path, changes, flags, refusal):
    text = text_of(flags=flags, **changes)
    assert equal(read(tmp_path, text), text)
    with pytest.raises(DescriptionError, match=refusal):
        read(tmp_path, text_of(**changes))


@pytest.mark.parametrize("flags", ["", NO_SPRINGS, NO_DAMPERS, NOTHING_PASSIVE])
def test_gravity_compensation(tmp_path, flags):
    text = text_of(flags=flags, body='gravcomp="0.5"')
    assert equal(read(tmp_path, text), text)
    acts = NOTHING_PASSIVE not in flags
    assert ("a_gravcomp" in read(tmp_path, text).components) == acts
    weightless = text_of(flags='gravity="disable"', body='gravcomp="0.5"')
    assert equal(read(tmp_path, weightless), weightless)


@pytest.mark.parametrize(
    ("what", "flags"),
    [
        ('stiffness="5" springlength="0.2"', NO_SPRINGS or NOTHING_PASSIVE),
        ('stiffness="5" springlength="-0.1 0.2"', NO_SPRINGS or NOTHING_PASSIVE),
        ('damping="5"', NO_DAMPERS or NOTHING_PASSIVE),
        ('frictionloss="5"', 'frictionloss="disable"'),
        ('frictionloss="5"', 'constraint="disable"'),
    ],
)
def test_fixed_tendons_pull_unless_they_are_switched_off(tmp_path, what, flags):
    joints = '<joint joint="j1" coef="1.5"/><joint joint="j2" coef="-0.7"/>'
    tendon = f'<tendon><fixed name="t" {what}>{joints}</fixed></tendon>'
    text = text_of(flags=flags, more=tendon)
    assert equal(read(tmp_path, text), text)
    assert "t" not in read(tmp_path, text).components
    acting = text_of(more=tendon)
    mechanism = read(tmp_path, acting)
    if "friction" in what:
        assert to_float(mechanism.components["t"].friction) == 5
    else:
        assert equal(mechanism, acting)


@two_flags
@pytest.mark.parametrize("flags", [NO_SPRINGS, NO_DAMPERS])
def test_one_of_two_flags_does_not_stop_the_medium(tmp_path, flags):
    with pytest.raises(DescriptionError, match="mbs does not model"):
        read(tmp_path, text_of(flags=flags, option='density="1000"'))


def names(kinds, prefix):
    return [name.removeprefix(prefix) for name in kinds.__members__ if name.startswith(prefix)]


def test_every_flag_of_this_mujoco_is_known():
    assert set(names(mujoco.mjtDisableBit, "mjDSBL_")) <= _EFFECTIVE | _WITHOUT_EFFECT
    assert set(names(mujoco.mjtEnableBit, "mjENBL_")) <= _ENABLED_WITHOUT_EFFECT
    assert not _EFFECTIVE & _WITHOUT_EFFECT


@pytest.mark.sweep
@pytest.mark.parametrize(
    "flag",
    [
        *(
            f'{n.lower()}="disable"'
            for n in names(mujoco.mjtDisableBit, "mjDSBL_")
            if n in _WITHOUT_EFFECT
        ),
        *(f'{n.lower()}="enable"' for n in names(mujoco.mjtEnableBit, "mjENBL_")),
    ],
)
def test_flags_without_effect_have_none(tmp_path, flag):
    """But on what MuJoCo calls an acceleration where it stands for a discrete step."""
    # The flag ipc is taken with this integrator alone, whose accelerations are those of its step.
    option = 'integrator="discrete"' if flag.startswith("ipc") else ""
    text, plain = (text_of(flags=one, option=option) for one in (flag, ""))
    efforts, accelerations = differences(read(tmp_path, text), text)
    if option:
        assert [efforts, accelerations] == differences(read(tmp_path, plain), plain)
    else:
        assert accelerations < 1e-10
        assert efforts < 1e-10 or flag.startswith("invdiscrete")


def test_flags_that_a_later_mujoco_may_have_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("mbs.formats.mjcf.reader._WITHOUT_EFFECT", set())
    with pytest.raises(DescriptionError, match="its flag 'contact' is set, which this reader does"):
        read(tmp_path, text_of(flags='contact="disable"'))


def test_bits_without_a_name_are_unknown():
    model = mujoco.MjModel.from_xml_string(text_of())
    assert Flags.of(mujoco, model).unknown == ()
    model.opt.disableflags = 1 << 29
    assert Flags.of(mujoco, model).unknown == ("bit 29",)


def test_old_words_are_refused_by_a_new_mujoco_and_new_words_by_an_old(tmp_path):
    foreign = 'spring="disable"' if ONE_FLAG else 'passive="disable"'
    with pytest.raises(DescriptionError, match=r"model.xml: mujoco refuses the file: .*flag"):
        read(tmp_path, text_of(flags=foreign))
