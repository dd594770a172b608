"""Trees and robots with loops: every joint from those on the way to the frame."""
