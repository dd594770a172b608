"""Wrong arguments of constructors raise one error that names them."""

import copy
import inspect
import pickle
from dataclasses import dataclass, replace

import pytest

import mbs
from mbs.components import Body, Box, Custom, DCMotor, Revolute, Spring, custom
from mbs.errors import ArgumentError, DescriptionError


class Pull(Custom):
    """A component of a user with one parameter."""

    at = custom.coordinate()
    force = custom.parameter("N")

    def loads(self, at):
        return {"at": at.force}


@dataclass(frozen=True, slots=True)
class Wide(Body):
    """A component of a user with a field of its own."""

    width: float = 1.0


WRONG = {
    "unknown": (
        lambda: Body("b", mas=1),
        r"Body b: there is no argument 'mas'; did you mean 'mass'",
    ),
    "joint": (lambda: Revolute("j", ax="z"), r"Revolute j: .* 'ax'; did you mean 'axis'"),
    "drive": (lambda: DCMotor("m", induct=1), "DCMotor m: .*did you mean 'inductance'"),
    "of a user": (lambda: Pull("p", "n", forc=1), "Pull p: .* 'forc'; did you mean 'force'"),
    "derived": (lambda: Wide("w", widht=1), "Wide w: .* 'widht'; did you mean 'width'"),
    "missing": (lambda: Spring("s", stiffness=1), "Spring s: a and b are missing; give .* a="),
    "missing in a component of a user": (lambda: Pull("p", "n"), "Pull p: force is missing"),
    "no name": (lambda: Body(mass=1), "Body: name is missing"),
    "twice": (lambda: Body("b", 1, mass=2), "Body b: mass is given twice"),
    "too many": (lambda: Box("b", *range(1, 9)), "Box b: 9 arguments without a name .* 6 are"),
    "mechanism": (lambda: mbs.Mechanism("m", grav=9), "Mechanism m: .*did you mean 'gravity'"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_argument_is_named(name):
    make, text = WRONG[name]
    with pytest.raises(ArgumentError, match=text) as caught:
        make()
    assert isinstance(caught.value, DescriptionError)
    assert isinstance(caught.value, TypeError)
    assert caught.value.__cause__ is None


def test_constructors_keep_their_signature_and_components_can_be_copied():
    assert list(inspect.signature(Body).parameters)[:2] == ["name", "mass"]
    part = Body("b", mass=2.0)
    for other in (pickle.loads(pickle.dumps(part)), copy.deepcopy(part), replace(part, mass=2.0)):
        assert other == part


def test_an_error_inside_of_a_constructor_is_not_one_of_its_arguments():
    class Broken(Pull):
        def __post_init__(self):
            raise TypeError("inside")

    with pytest.raises(TypeError, match="inside") as caught:
        Broken("p", "n", 1.0)
    assert not isinstance(caught.value, ArgumentError)
