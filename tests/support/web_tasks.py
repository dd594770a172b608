"""Tasks that tests of the app run in child processes."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from mbs.errors import Unclosable
from mbs.progress import progress


def counted(system, upto):
    with progress("counting", 0.0, upto, quiet=True) as reached:
        for k in range(upto):
            reached(k + 1.0)
    return system.name, system.nq, os.getpid()


def refused(system, sentence):
    raise Unclosable(sentence)


def broken(system):
    return 1 / 0


def vanished(system):
    os._exit(3)


def endless(system, told):
    """Leaves a temporary file and another process behind, says both, and never ends."""
    scratch = Path(tempfile.mkdtemp()) / "scratch"
    scratch.write_text("half")
    other = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    Path(told).with_suffix(".part").write_text(f"{scratch}\n{os.getpid()}\n{other.pid}")
    Path(told).with_suffix(".part").replace(told)
    with progress("waiting", 0.0, 1.0, quiet=True) as reached:
        while True:
            reached(0.5)
            time.sleep(0.01)
