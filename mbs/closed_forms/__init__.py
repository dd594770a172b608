"""Closed forms: the joints of a loop one after the other, by equations with few roots.

Rings of joints by the shape of the loop (planar, spatial), Paul's method, Pieper's method, and the
general six-joint chain of Raghavan and Roth. Loops and inverse geometry both solve with them.
"""
