"""A robot as the user types it: text cells, errors in cells, and files that it is read from."""
