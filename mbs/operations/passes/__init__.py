"""Passes: each makes an equal graph, cheaper in one respect."""
