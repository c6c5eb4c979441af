"""Adversaries that know the robot and want to hit it, and campaigns of them."""
