"""User interfaces without Python programming: the command line and the app in the browser."""
