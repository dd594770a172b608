"""The commands as a group whose errors are one sentence and an exit code."""

from __future__ import annotations

import sys
from typing import Any

import typer
import typer.core

from mbs.errors import MbsError

REFUSED = 1


class Commands(typer.core.TyperGroup):
    """Commands that say an `MbsError` as one sentence on the standard error."""

    def invoke(self, ctx: Any) -> Any:
        """Run the chosen command."""
        try:
            answer = super().invoke(ctx)
            sys.stdout.flush()
        except MbsError as error:
            typer.echo(f"mbs: {error}", err=True)
            raise typer.Exit(REFUSED) from None
        return answer
