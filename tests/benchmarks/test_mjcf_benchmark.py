"""benchmarks/mjcf_files.py on files of our own: what is equal, what is not, what is refused."""

import pytest

pytest.importorskip("mujoco")
mjcf_files = pytest.importorskip("mjcf_files")

LEG = """<mujoco><worldbody>
  <body name="b" pos="0 0 1"><freejoint name="f"/><geom size=".1"/>
    <body name="a"><joint name="j1" axis="0 1 0" frictionloss="1"/>
      <geom type="capsule" size=".03" fromto="0 0 0 .4 0 .1"/>
      <body name="c" pos=".4 0 .1"><joint name="j2" axis="0 1 0"/>
        <geom type="capsule" size=".03" fromto="0 0 0 .3 0 -.2"/></body></body>
    <body name="d" pos=".2 0 -.3"><joint name="j3" type="ball"/>
      <geom type="capsule" size=".03" fromto="0 0 0 .5 0 .2"/></body></body>
</worldbody><option {}/>
<equality><connect body1="c" body2="d" anchor=".3 0 -.2"/></equality></mujoco>"""


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        (LEG.format(""), "equal"),
        (LEG.format('density="1"'), "refused"),
        ("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>", "nothing moves"),
        ("<mujoco><wordbody/></mujoco>", "not read by MuJoCo"),
    ],
)
def test_a_file_is_compared(tmp_path, text, kind):
    path = tmp_path / "model.xml"
    path.write_text(text, encoding="utf-8")
    outcome = mjcf_files.compared(path)
    assert (outcome.kind, bool(outcome.text)) == (kind, kind == "refused")


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda model: model.body_mass.__imul__(1 + 1e-8), "inverse dynamics"),
        (lambda model: model.jnt_pos.__iadd__(1e-7), "poses"),
    ],
)
def test_a_small_difference_is_seen(tmp_path, monkeypatch, change, what):
    path = tmp_path / "model.xml"
    path.write_text(LEG.format(""), encoding="utf-8")
    mujoco, system = mjcf_files.mujoco, mjcf_files.read_mjcf(path)
    model = mujoco.MjModel.from_xml_path(str(path))
    change(model)
    twin = mjcf_files.Twin(mjcf_files._opened(system).assemble(), model, path)
    assert what in twin.differences(mjcf_files.np.random.default_rng(0))
