"""What the planner claims, judged by other means: plain NumPy in float64, no grid, no Taichi."""
