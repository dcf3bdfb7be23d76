"""Scenes: chains, networks with walls and contacts that form and open, and ensembles of these.

A scene defines masses, bonds, forcing and states; `tensegrity.engine` and `tensegrity.runs`
advance it in time.
"""
