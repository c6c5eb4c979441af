"""The simulated world: movers, walls, range finders, scenarios, episodes and their judge."""
