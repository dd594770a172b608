"""Paul's method: a loop is split in every way, and its simplest equations are solved first."""

from mbs.closed_forms.paul.search import paul

__all__ = ["paul"]
