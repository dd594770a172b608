"""From postures to answers: distinct roots, self-motions, branches, limits, reasons."""
