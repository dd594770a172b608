"""Completions of the shell: names of robots, robot files, keys of models, languages."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from pkgutil import iter_modules

import typer

SUFFIXES = (".toml", ".par", ".urdf", ".xacro", ".sdf", ".world", ".xml")
"""Suffixes of robot files."""


def robot_names() -> list[str]:
    """Return the names of the catalogue, by the rule of `catalogue` but without CasADi."""
    found = importlib.util.find_spec("mbs.robots")
    folders = found.submodule_search_locations if found is not None else None
    return [m.name[1:] for m in iter_modules(folders or []) if m.name.startswith("_")]


def robots(incomplete: str) -> list[str]:
    """Return names of the catalogue, folders and robot files that complete a word.

    Args:
        incomplete: beginning of the word, as typed in the shell.
    """
    names = [name for name in robot_names() if name.startswith(incomplete)]
    return [*names, *_files(incomplete, SUFFIXES)]


def keys(incomplete: str) -> list[tuple[str, str]]:
    """Return (key, title) of the models whose key completes a word.

    Args:
        incomplete: beginning of the word, as typed in the shell.
    """
    from mbs.app.tasks.equations import entries

    return [(e.key, e.title) for e in entries() if e.key.startswith(incomplete)]


def options(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return "NAME=" for the options of the model on the command line that complete a word.

    Args:
        ctx: context of the command, with the arguments that are already typed.
        incomplete: beginning of the word, as typed in the shell.
    """
    from mbs.app.tasks.equations import entries

    words = {ctx.params.get("key"), *ctx.args}  # ctx.args holds it while the option has no value
    named = [entry for entry in entries() if entry.key in words]
    names = [option.name for entry in named for option in entry.options]
    return [f"{name}=" for name in names if name.startswith(incomplete)]


def languages(incomplete: str) -> list[str]:
    """Return the languages of generated text that complete a word.

    Args:
        incomplete: beginning of the word, as typed in the shell.
    """
    from mbs.export.languages import LANGUAGES

    return [name for name in LANGUAGES if name.startswith(incomplete)]


def _files(incomplete: str, suffixes: tuple[str, ...]) -> list[str]:
    """Return folders (with "/") and files with given suffixes whose path completes a word."""
    folder, _, start = incomplete.rpartition("/")
    place = Path(f"{folder}/" if folder or incomplete.startswith("/") else ".")
    if not place.is_dir():
        return []
    before = incomplete[: len(incomplete) - len(start)]
    shown = [path for path in sorted(place.iterdir()) if path.name.startswith(start)]
    return [
        f"{before}{path.name}{'/' if path.is_dir() else ''}"
        for path in shown
        if (path.is_dir() or path.suffix.lower() in suffixes) and not path.name.startswith(".")
    ]
