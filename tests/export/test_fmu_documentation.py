"""What people read of an FMU: its page, with its drawing."""

import math
import xml.etree.ElementTree as ET

import pytest
from fmu_models import pendulum
from support.catalogue_systems import catalogue_system

from mbs.export.fmu.documentation import documentation
from mbs.export.fmu.system_fmu import fmu_model


@pytest.fixture(scope="module")
def page():
    return documentation(fmu_model(catalogue_system("four_bar")))


def test_the_page_is_well_formed_and_needs_no_other_file(page):
    body = page[page.index("<main>") : page.index("</main>") + len("</main>")]
    root = ET.fromstring(body)
    titles = [h.text for h in root.iter("h2")]
    assert titles[:5] == [
        "Joints",
        "Placement of the links",
        "Inertial parameters of the links",
        "Bodies",
        "Loops",
    ]
    assert "Operations of the equations" in titles
    assert "src=" not in page
    assert "href=" not in page
    assert 'name="viewport"' in page
    assert "prefers-color-scheme: dark" in page


def test_the_page_tells_names_units_and_starts(page):
    root = ET.fromstring(page[page.index("<main>") : page.index("</main>") + len("</main>")])
    cells = [["".join(c.itertext()) for c in row] for row in root.iter("tr")]
    model = fmu_model(catalogue_system("four_bar"))
    for entry in model.entries:
        row = next(row for row in cells if row[0] == entry.variable.name)
        assert row[1] == entry.variable.unit
    guess = next(v for v in model.dependents if v.name == "j2.solved")
    row = next(row for row in cells if row[0] == "j2.solved")
    assert row[2] == f"{guess.start:.6g} ({math.degrees(guess.start):.6g} deg)"


def test_the_page_counts_operations(page):
    from mbs.operations import count

    model = fmu_model(catalogue_system("four_bar"))
    counted = count(model.rhs)
    assert f"<td>{counted.mul}</td><td>{counted.add}</td>" in page


def test_a_page_without_a_mechanism_escapes_its_text():
    text = documentation(pendulum())
    assert "vertical &lt;down&gt;" in text
    assert "<svg" not in text


def test_the_caption_says_what_the_colours_of_the_drawing_mean(page):
    assert "four_bar at its start, in the plane of the motion." in page
    assert "Orange: driven joints; Red: joints that close loops." in page
    (word,) = (part for part in page.split("<figcaption>")[1:])
    assert 'class="joint active-100"' in page.split("<figcaption>")[0]
    assert 'class="loop loop-100"' in page.split("<figcaption>")[0]
    assert word.startswith("four_bar")
