"""State equations of the independent joints and of the tree, with their inputs and events.

`forms` has the state equations of FMUs, `tree.full_state` that of a simulation. Both are made of
the equations of motion in `equations`.
"""
