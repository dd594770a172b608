"""Recursive algorithms of multibody dynamics on a tree of links, as CasADi SX expressions."""
