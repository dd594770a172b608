"""Paths followed on one branch."""
