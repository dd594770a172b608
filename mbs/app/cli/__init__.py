"""The command `mbs`: what the package does, from a terminal.

Exit codes: 0 where all went well; 1 with one sentence on the standard error where mbs refused or
could not go on, and silently where the reader of its output went away; 2 for words that the
command line does not know; 130 when interrupted.

A fault of mbs itself is one sentence as well; with MBS_TRACEBACK=1 in the environment Python shows
where it happened.
"""

from __future__ import annotations

import errno
import os
import sys

__all__ = ["main"]

_TRACEBACK = "MBS_TRACEBACK"


def main() -> None:
    """Run the command line on the words that the shell gave, then leave with an exit code."""
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
    """Let what is still to be written vanish, so that leaving complains no more."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
