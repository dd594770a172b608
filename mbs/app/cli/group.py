"""Command group that reports errors by a message and an exit code."""

from __future__ import annotations

import sys
from typing import Any

import typer
import typer.core

from mbs.errors import MbsError

REFUSED = 1


class Commands(typer.core.TyperGroup):
    """Command group that prints the message of an `MbsError` on standard error and exits with 1."""

    def invoke(self, ctx: Any) -> Any:
        """Run the selected command; an MbsError becomes a message and the exit code 1."""
        try:
            answer = super().invoke(ctx)
            sys.stdout.flush()
        except MbsError as error:
            typer.echo(f"mbs: {error}", err=True)
            raise typer.Exit(REFUSED) from None
        return answer
