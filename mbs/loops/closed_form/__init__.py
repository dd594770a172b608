"""Loops solved joint by joint without iteration: one kernel a file, chosen by the geometry.

places          where the positions stand of joints, of cut joints and of rods that spin
trigonometry    sine and cosine of an angle from its equation
ring            a loop as its unknown joints and the poses between them
root            what a kernel finds: the ways to close a loop
survey          what holds of a loop at random positions, from which its class is read
centre          the points that balls and meeting axes turn about
distance, aim, spin, ball                               kernels: links between such points
planar, three_turns, parallelogram, one_slide, two_slides, normal, confined    in a plane
orientation, sphere, slides                             turns first, then slides
bennett, trilateration, coupling                        special measures, shared slides, gears
split, closed_samples    whatever is left, by Paul's method, and numbers at which a loop closes
free_body       a body whose pose is known
dispatch        the kernel for a loop
stage           one step of a plan, and which of its ways lead to a posture
plan            the loops of a system in the order in which they can be solved
verified        a plan held against postures
known           joints that may be known together
posed           the plan for a frame whose pose is known
"""
