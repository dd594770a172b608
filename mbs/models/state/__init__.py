"""State equations of the independent joints and of the tree, with their inputs and events."""
