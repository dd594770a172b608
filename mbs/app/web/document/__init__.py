"""A robot as typed: text cells, what is wrong with them, the files they come from."""
