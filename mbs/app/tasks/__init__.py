"""What the command line and the app do: functions of a System and plain options to plain data."""
