"""What stands between the planner and a real robot. The planner never imports this."""
