"""Grids: geometry, the scan made into space and time, known maps."""
