"""What the command line and the desk do: functions of a System and plain options to plain data."""
