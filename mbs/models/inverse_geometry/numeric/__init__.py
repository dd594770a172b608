"""Postures in numbers, compiled: polished, searched, by the general method, nearest."""
