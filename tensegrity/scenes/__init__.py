"""What is run: chains, networks with walls, contacts that come and go, lanes of them.

A scene says what its bonds, masses and states are; how it is advanced is the engine's and the
runs' matter.
"""
