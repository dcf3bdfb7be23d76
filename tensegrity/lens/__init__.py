"""An acoustic lens: chains of prisms side by side, whose prestrains bring pulses to one focus."""
