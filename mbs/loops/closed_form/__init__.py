"""Loops solved joint by joint without iteration: one kernel a file, chosen by the geometry.

trigonometry    sine and cosine of an angle from its equation
ring            a loop as its unknown joints and the poses between them
root            what a kernel finds: the two ways to close a loop, and where they meet
coupling, rod, two_turns, turns, parallelogram, one_slide, two_slides, sphere    the kernels
survey          numbers of the ring at random positions, from which its class is read
dispatch        the kernel for a loop
plan            the loops of a system in the order in which they can be solved
"""
