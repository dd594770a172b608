"""Texts of models, line by line."""

import functools
import re

import casadi
from casadi import Function
from support.catalogue_systems import catalogue_system

import mbs
import mbs.models
from mbs.export.languages import LANGUAGES

PROPER = [name for name in LANGUAGES if name != "octave"]


@functools.cache
def idm(name="puma560"):
    return mbs.models.inverse_dynamics(catalogue_system(name))


def lines(text):
    """Left and right side of every assignment of a C text."""
    return dict(re.findall(r"const double (\w+) = (.*?);", " ".join(text.split())))


def vector(results, x, name="f"):
    return Function(name, [x], [casadi.vertcat(*results)], ["x"], ["y"])
