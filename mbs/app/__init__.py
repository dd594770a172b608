"""What people use without writing Python: the command line and the desk in the browser."""
