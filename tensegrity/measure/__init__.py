"""What is read from runs: arrivals, pulses, budgets of energy and momentum."""
