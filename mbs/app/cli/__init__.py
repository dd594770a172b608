"""Command line interface `mbs`.

Exit codes: 0 on success. 1 after an error, with a message on standard error, or silently if the
reader of the output has closed it. 2 for unknown commands or options. 130 after an interruption.

An internal error of mbs is also reported by a single message. With MBS_TRACEBACK=1 in the
environment, Python prints the traceback.
"""

from __future__ import annotations

import errno
import os
import sys

__all__ = ["main"]

_TRACEBACK = "MBS_TRACEBACK"


def main() -> None:
    """Run the command line with the arguments of the process, then exit with an exit code.

    The module docstring lists the exit codes.
    """
    from mbs.app.cli.application import application

    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="replace")  # type: ignore[union-attr]
    try:
        try:
            application(prog_name="mbs")
        finally:
            sys.stdout.flush()
    except Exception as error:
        if os.environ.get(_TRACEBACK):
            raise
        if not isinstance(error, OSError):
            sys.exit(
                f"mbs: this is a fault of mbs itself ({type(error).__name__}: {error}); please"
                f" report it with what is shown when {_TRACEBACK}=1 is set"
            )
        if error.filename is not None:
            sys.exit(f"mbs: {error.filename}: {error.strerror}")
        _close_output()
        reader_gone = error.errno == errno.EPIPE
        sys.exit(1 if reader_gone else f"mbs: the output cannot be written ({error.strerror})")


def _close_output() -> None:
    """Redirect the output to the null device, so that flushing it at exit raises no error."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
