"""Checks certificates of passive safety with NumPy alone: no planner, no grid, no Taichi."""
