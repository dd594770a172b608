"""Reader and writer of MuJoCo model files (MJCF)."""
