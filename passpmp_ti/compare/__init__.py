"""Safety modes side by side: the same worlds, driven in each, and what came of it."""
