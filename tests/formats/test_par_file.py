"""The lines of a .par file: comments, remarks and vectors, also in long files without sense."""

import pytest

from mbs.errors import DescriptionError
from mbs.formats.par import ParFile

LONG = 1_000_000


def test_comments_are_taken_out_and_lines_keep_their_numbers():
    text = "(* a\n b *) NL = 2\n(* Value L = 0.3 *) d = {0, (* two\n*) L}\n"
    file = ParFile.of("f.par", text)
    assert file.entries == {"NL": (2, ("2",)), "d": (3, ("0", "L"))}
    assert file.remarks == {("Value", "L"): (3, "0.3")}


def test_a_name_and_a_source_are_what_stands_between_their_quotes():
    file = ParFile.of("f.par", "(* Robotname = ' rx 90 ' and more *)\n(*Source='Khalil's book' *)")
    assert (file.name, file.source) == ("rx 90", "Khalil's book")
    other = ParFile.of("f.par", "(* Robotname = open *) (* Source = 'no end *)")
    assert (other.name, other.source) == ("", "")


def test_the_first_name_counts_and_prose_is_no_remark():
    text = "(* Robotname = 'a' *)(* Robotname = 'b' *)(* Value of L = 3 *)(* Value L *)"
    file = ParFile.of("f.par", text + "(* Value M = 1\n2 *)")
    assert file.name == "a"
    assert file.remarks == {}


@pytest.mark.parametrize(
    "text",
    [
        "(*" * (LONG // 2),
        "(* Value a" * (LONG // 10),
        "(* Source = '" * (LONG // 13),
        "(* Robotname =" * (LONG // 14),
        "d = {" + "1\n" * (LONG // 2),
        "(" * LONG,
        "x" * LONG,
    ],
    ids=["comments", "remarks", "sources", "names", "braces", "brackets", "letters"],
)
def test_a_long_file_without_sense_is_refused(text):
    """It ends: a search that starts anew at every bracket would take hours."""
    with pytest.raises(DescriptionError, match=r"f\.par:1: .*is not an assignment") as caught:
        ParFile.of("f.par", text)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize(
    "text",
    [
        "(* Value a =" + " " * LONG + "*)",
        "(* Source = '" + "' " * (LONG // 2) + "*)",
        "(* x *)\n" * (LONG // 8),
        "d = {" + "f(1, 2)" * (LONG // 7) + "}",
    ],
    ids=["blanks", "quotes", "comments", "values"],
)
def test_a_long_file_is_read(text):
    assert ParFile.of("f.par", text).name == ""


def test_long_vectors_have_their_values():
    file = ParFile.of("f.par", "d = {" + "1.5,\n" * (LONG // 5) + "2}")
    line, values = file.entries["d"]
    assert (line, len(values), values[0], values[-1]) == (1, LONG // 5 + 1, "1.5", "2")
