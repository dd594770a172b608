"""State equations of the independent joints and of the tree, what drives them, their events."""
