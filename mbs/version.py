"""Version of mbs. The build of the package reads it from this file."""

__version__ = "0.2.0"
