"""Faults of sensors, clocks and planners, and broken premises, put into running cycles."""
