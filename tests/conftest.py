"""Settings of every run of the tests."""

import gc
import os
import sys

import pytest
from hypothesis import settings
from support.sweeps import EVERY_CASE, left_out

from mbs.errors import CompilerError
from mbs.native import compiler

# Each worker of a run fills a core: threads of linear algebra would only wait for one another.
# NumPy reads it when it is loaded, which is after this file.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Programs that tests start would compile every module of the package anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# While tests are collected nothing is thrown away: there is nothing to look for.
gc.disable()

# Where values are compared the compiler need not take its time; with every case it does.
if not EVERY_CASE:
    os.environ.setdefault("MBS_OPTIMIZE", "0")

# Tests move constants that equations are derived with, and their key does not know them.
os.environ.setdefault("MBS_KEEP_EQUATIONS", "0")

# Which part of a sweep runs is the same everywhere, so that what passed passes; another seed tries
# another part.
os.environ.setdefault("MBS_TEST_SEED", "739943")

# What passed passes again: examples are the same in every run.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")


def pytest_configure(config):
    """The markers of this project."""
    for marker in (
        "sweep: many cases of one rule, of which a part runs unless MBS_TEST_ALL=1",
        "slow: one of the slowest tests, which runs only if MBS_TEST_ALL=1",
    ):
        config.addinivalue_line("markers", marker)


def pytest_report_header(config):
    """What makes a run repeatable."""
    if EVERY_CASE:
        return "sweeps: all cases; slow tests too"
    return f"sweeps: a part, MBS_TEST_SEED={os.environ['MBS_TEST_SEED']}; no slow tests"


# Whole programs, of up to a quarter of a minute: begun last, one would run on beside an idle core.
LONG = {"test_examples.py", "test_readme.py", "test_structure.py"}


def pytest_collection_modifyitems(config, items):
    """Long ones first; of sweeps, of rules with several seeds and of slow tests see `left_out`."""
    items.sort(key=lambda item: item.path.name not in LONG)
    if EVERY_CASE:
        return
    left = left_out(items, os.environ["MBS_TEST_SEED"])
    config.hook.pytest_deselected(items=[item for item in items if item in left])
    items[:] = [item for item in items if item not in left]


def pytest_collection_finish():
    """Modules and tests stay until the end: the collector need not walk through them again."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    gc.enable()


@pytest.fixture
def no_compiler(monkeypatch):
    """A computer without a C compiler."""

    def find(*_):
        raise CompilerError("no C compiler was found")

    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(compiler, "_find", find)
