"""Other planners behind the navigator's door, to be compared with it."""
