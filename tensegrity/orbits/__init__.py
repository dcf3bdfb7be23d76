"""Stability of exact waves and of time-periodic orbits: tangents of a run by the reverse loop,
multipliers, and orbits by shooting."""
