"""Pictures and videos of what the planner saw, thought and did."""
