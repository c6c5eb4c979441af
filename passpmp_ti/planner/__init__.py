"""From a model of the future to a verified trajectory."""
