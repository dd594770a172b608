from mbs.text import did_you_mean, quoted


def test_the_nearest_names_come_first():
    known = ["knee", "hip", "ankle"]
    assert did_you_mean("kne", known) == "did you mean 'knee'? use one of knee, hip, ankle"
    assert did_you_mean("kne", ["knee"]) == "did you mean 'knee'?"
    assert did_you_mean("q", known) == "use one of knee, hip, ankle"
    assert did_you_mean(3, []) == "use one of (none)"


def test_long_lists_are_cut():
    text = did_you_mean("other", [f"q{k}" for k in range(30)])
    assert text.endswith("q18, q19 and 10 more")


def test_quoted_is_one_short_line():
    assert quoted("a\nb") == r"'a\nb'"
    assert len(quoted("x" * 1000)) < 100
    assert "more digits than can be read" in quoted(10**5000)
