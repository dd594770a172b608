"""The version of mbs."""

__version__ = "0.1.0"
