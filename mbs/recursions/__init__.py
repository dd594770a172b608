"""Textbook algorithms over the tree: CasADi SX in, SX out; no names, no files."""
