"""Granular crystals on the engine of `tensegrity`: contact laws, chains and guides to come."""
