"""What rigid stops and Coulomb friction refuse, and what the models make of them."""

import numpy as np
import pytest
from support.messages import refused

import mbs
import mbs.models
from mbs.components import CoulombFriction, PointMass, Prismatic, RigidStop
from mbs.errors import DescriptionError, ModelError


def rail(*elements):
    """Two bodies on one rail."""
    m = mbs.Mechanism("rail", gravity=(0, 0, 0))
    for name in ("x", "y"):
        m.connect(
            m.world, Prismatic(name, axis="x", actuated=True), m.add(PointMass(f"m_{name}", 2.0))
        )
    for element in elements:
        m.add(element)
    return m.assemble()


STOP = RigidStop("end", joint="x", upper=1.0)
DRY = CoulombFriction("dry", joint="x", sliding=3.0)


@pytest.mark.parametrize(
    ("kind", "fields", "parts"),
    [
        (RigidStop, {}, ("neither lower nor upper",)),
        (RigidStop, {"lower": 2, "upper": 1}, ("lower is 2 and upper is 1", "in order")),
        (RigidStop, {"upper": 1, "restitution": 1.2}, ("restitution is 1.2", "between 0 and 1")),
        (RigidStop, {"upper": 1, "restitution": -0.1}, ("restitution is -0.1",)),
        (RigidStop, {"upper": 1, "rest_speed": 0}, ("rest_speed is 0", "more than zero")),
        (CoulombFriction, {"sliding": -1}, ("sliding is -1",)),
        (CoulombFriction, {"sliding": 2, "sticking": 1}, ("sticking is 1", "sticking >= sliding")),
        (CoulombFriction, {"sliding": 0}, ("does nothing",)),
    ],
)
def test_descriptions_are_checked(kind, fields, parts):
    refused(DescriptionError, "c: ", *parts, by=lambda: kind("c", joint="x", **fields))


def test_a_value_of_a_symbol_is_checked_like_a_number():
    m = mbs.Mechanism("m", parameters={"e": 2.0})
    m.connect(m.world, Prismatic("x", axis="x"), m.add(PointMass("mass", 1.0)))
    m.add(RigidStop("end", joint="x", upper=1.0, restitution="e"))
    refused(DescriptionError, "restitution is 2", by=m.assemble)


def test_the_smooth_models_leave_contacts_out_and_the_report_says_so():
    plain, touched = rail(), rail(STOP, DRY)
    q, v, a = [1.5, 0.0], [0.3, 0.1], [1.0, 2.0]
    for name, given in (("inverse_dynamics", (q, v, a)), ("direct_dynamics", (q, v, a))):
        build = getattr(mbs.models, name)
        assert np.array_equal(np.array(build(plain)(*given)), np.array(build(touched)(*given)))
    assert touched.report().splitlines()[-2:] == [
        "RigidStop end acts on x, in simulations; the other models leave it out.",
        "CoulombFriction dry acts on x, in simulations; the other models leave it out.",
    ]


def test_a_placed_mechanism_brings_its_contacts():
    inner = mbs.Mechanism("inner")
    inner.connect(inner.world, Prismatic("x", axis="x"), inner.add(PointMass("mass", 1.0)))
    inner.add(STOP)
    outer = mbs.Mechanism("outer", gravity=(1.0, 0, 0))
    outer.connect(outer.world, outer.add(inner, "left")["world"])
    result = mbs.simulate.run(outer.assemble(), 2.0, quiet=True)
    assert result.events[0][1:] == ("left.end", "rests at upper")
    assert result.events[0][0] == pytest.approx(np.sqrt(2.0), abs=1e-8)


def test_two_contacts_of_a_kind_on_one_coordinate_are_refused():
    other = RigidStop("other", joint="x", lower=0.0)
    system = rail(STOP, other)
    refused(
        ModelError,
        "end and other act both on x",
        "one RigidStop",
        by=lambda: mbs.simulate.run(system, 1.0, quiet=True),
    )


def test_a_start_beyond_a_limit_is_refused():
    refused(
        ModelError,
        "x starts at 1.2, beyond the upper limit 1",
        "start inside",
        by=lambda: mbs.simulate.run(rail(STOP), 1.0, q0={"x": 1.2}, quiet=True),
    )


def test_a_motion_where_a_contact_acts_is_refused():
    refused(
        ModelError,
        "motion prescribes x, on which",
        "leave out one of the two",
        by=lambda: mbs.simulate.run(rail(DRY), 1.0, motion={"x.v": 1.0}, quiet=True),
    )


def test_a_motion_that_loops_hand_to_a_contact_is_refused():
    m = mbs.load("slider_crank")
    driven, other = (c.name for c in m.assemble().coordinates[:2])
    m.add(CoulombFriction("dry", joint=other, sliding=1.0))
    refused(
        ModelError,
        f"the motions that are prescribed move {other} through the loops",
        by=lambda: mbs.simulate.run(m.assemble(), 1.0, motion={f"{driven}.v": 1.0}, quiet=True),
    )


def test_a_dae_is_refused():
    refused(
        ModelError,
        "dae has no events yet, which RigidStop end needs",
        "use a JointStop, or mbs.simulate.run",
        by=lambda: mbs.models.dae(rail(STOP)),
    )
    refused(
        ModelError,
        "dae has no events yet, which CoulombFriction dry needs",
        "use a JointFriction",
        by=lambda: mbs.models.dae(rail(DRY)),
    )
