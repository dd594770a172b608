"""Reader and writer of SDFormat robot files."""
