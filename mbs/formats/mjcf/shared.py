"""Rule for names in MJCF files that its reader and its writer share."""

from collections.abc import Container


def numbered_name(name: str, *taken: Container[str]) -> str:
    """Return a name that is not used yet; numbers from 2 are appended until it is unused.

    Args:
        name: desired name.
        *taken: containers of used names.
    """
    found, number = name, 2
    while any(found in names for names in taken):
        found, number = f"{name}{number}", number + 1
    return found
