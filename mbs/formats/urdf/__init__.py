"""Reader and writer of URDF robot files."""
