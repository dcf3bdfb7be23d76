"""Error against cost of a user's own scene: methods and steps compared, the largest stable step
found, drift of energy, other programs beside; and what simpler models of a scene cost in truth."""
