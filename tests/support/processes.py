"""Other processes, looked at through /proc."""

from pathlib import Path

import pytest

IN_PROC = pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks at processes through /proc")


def is_alive(pid):
    """Whether a process runs; one that only waits to be buried does not."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"
