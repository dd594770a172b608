import pytest

import mbs.robots
from mbs import Mechanism
from mbs.components import KhalilBody
from mbs.errors import DescriptionError
from mbs.robots import catalogue, load

ACTIVE = {
    "puma560": 6,
    "stanford": 6,
    "rx90": 6,
    "tx90": 6,
    "kr6": 6,
    "irb120": 6,
    "ur5": 6,
    "crx10": 6,
    "panda": 7,
    "youbot": 5,
    "manseur_doty": 6,
    "gantry": 6,
    "scara": 4,
    "planar_2r": 2,
    "cart_pole": 1,
    "two_branch_tree": 7,
    "sr400": 6,
    "five_bar": 2,
    "four_bar": 1,
    "slider_crank": 1,
    "single_cylinder_engine": 1,
    "modelica_four_bar": 0,
    "modelica_rod_four_bar": 0,
    "simple_pendulum": 0,
    "n_four_bar": 0,
    "andrews_squeezer": 1,
    "bricard": 0,
    "flyball_governor": 0,
    "akr3000": 6,
    "delta": 3,
    "stewart_platform": 6,
    "differential_wrist": 2,
    "whipple_bicycle": 3,
}


def test_catalogue_is_complete():
    assert set(catalogue()) == set(ACTIVE)


@pytest.mark.parametrize("name", ACTIVE)
def test_every_robot(name):
    m = catalogue()[name]()
    assert isinstance(m, Mechanism)
    assert m.name == name
    assert m.source
    assert sum(joint.actuated is True for joint in m.joints()) == ACTIVE[name]
    assert m.parameters() == ()
    assert getattr(mbs.robots, name) is catalogue()[name]
    assert catalogue()[name].__doc__
    for body in m.bodies():
        assert not isinstance(body, KhalilBody) or not body.grouped


@pytest.mark.sweep
@pytest.mark.parametrize("name", ACTIVE)
def test_every_robot_assembles(name):
    """By its own guess, without a word from the user."""
    system = catalogue()[name]().assemble()
    assert len(system.tree.links) >= 1
    assert system.report()


def test_load_dict_and_files(tmp_path):
    data = {"name": "one", "frame": [{"antecedent": 0, "d": "L"}]}
    assert load(data, {"L": 2.0}).parameters()[0].default == 2.0
    (tmp_path / "one.toml").write_text('name = "one"\n[[frame]]\nantecedent = 0\nd = "L"\n')
    assert load(tmp_path / "one.toml", {"L": 3}).parameters()[0].default == 3
    (tmp_path / "one.par").write_text(
        "NL = 1\nNJ = 1\nant = {0}\nsigma = {0}\ntheta = {t1}\nd = {L}\nG={0,0,0}"
    )
    symbols = load(str(tmp_path / "one.par"), {"L": 1}).parameters()
    assert next(p.default for p in symbols if p.name == "L") == 1
    (tmp_path / "one.URDF").write_text('<robot name="one"><link name="a"/></robot>')
    assert load(tmp_path / "one.URDF").name == "one"


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("puma506", "robot 'puma506' is not in the catalogue; did you mean 'puma560'"),
        ("arm.stl", r"arm.stl: files of this kind are not read; .*use one of .toml"),
        ("none.par", "none.par: the file cannot be read"),
        (3, "neither a name, a dict nor a path"),
    ],
)
def test_unknown_source(source, message):
    with pytest.raises(DescriptionError, match=message):
        load(source)


def test_unknown_parameter():
    with pytest.raises(DescriptionError, match=r"puma560: parameter 'D3' is not used"):
        load("puma560", {"D3": 1})
