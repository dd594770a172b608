"""Tasks of the command line and the app: functions of a System and plain options to plain data."""
