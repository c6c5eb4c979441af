"""Certificates: from a cycle of the planner to a file that others can check."""
