"""What every error message of mbs has to be."""

import re

import pytest


def refused(error, *parts, by):
    """The call `by` raises `error` with a message of one sentence that holds all the parts."""
    with pytest.raises(error) as caught:
        by()
    message = str(caught.value)
    for part in parts:
        assert part in message, message
    assert "\n" not in message
    assert not message.endswith(".")
    assert not re.search(r"[^.\s\d]\. +[A-Z]", message), message
    return message
