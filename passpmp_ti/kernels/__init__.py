"""Taichi only: physics as pure functions, kernels as plain loops over arrays."""
