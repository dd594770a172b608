"""The panel of inverse geometry: of seven joints one is placed by the visitor."""

from support.panel_pages import PATIENT, visited

from mbs.app.web.menus import build_menus


def test_a_seventh_joint_stays_or_takes_many_positions(monkeypatch):
    async def visit(user, app):
        user.find(marker="menu igm-general").click()
        await user.should_see("Solve", retries=PATIENT)
        user.find("Solve").click()
        await user.should_see(marker="headline", retries=PATIENT)
        await user.should_see("locked: q3 = 0")
        (positions,) = user.find(marker="positions").elements
        positions.set_value("given")
        (at,) = user.find(marker="position").elements
        assert at.visible
        at.set_value("pi/10")
        user.find("Solve").click()
        await user.should_see("locked: q3 = 0.3142", retries=PATIENT)
        positions.set_value("16")
        assert not at.visible
        user.find("Solve").click()
        await user.should_see("16 positions of q3", retries=PATIENT)
        (joint,) = user.find(marker="redundant").elements
        assert joint.options == [f"q{k}" for k in range(1, 8)]
        joint.set_value("q7")  # with which there is a closed form
        positions.set_value("present")
        (method,) = user.find(marker="method").elements
        method.set_value("pieper")
        user.find("Solve").click()
        await user.should_see("by pieper; locked: q7 = ", retries=PATIENT)

    visited(build_menus, "panda", visit, monkeypatch)


def test_six_joints_have_none_to_place(monkeypatch):
    async def visit(user, app):
        user.find(marker="menu igm-general").click()
        await user.should_see("Solve", retries=PATIENT)
        await user.should_not_see(marker="positions")

    visited(build_menus, "puma560", visit, monkeypatch)
