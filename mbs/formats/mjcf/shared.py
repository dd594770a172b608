"""Rule for names in MJCF files that its reader and its writer share."""

from collections.abc import Container


def numbered_name(name: str, *taken: Container[str]) -> str:
    """Return the name, with the first free number from 2 if it is taken."""
    found, number = name, 2
    while any(found in names for names in taken):
        found, number = f"{name}{number}", number + 1
    return found
