"""Observables of runs: arrivals, pulses, and budgets of energy and momentum."""
