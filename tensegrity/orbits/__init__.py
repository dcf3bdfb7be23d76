"""Time-periodic orbits by shooting, and the Floquet multipliers of orbits and of exact waves from
the tangents of a run."""
