"""The tensegrity prism: its potential, its equilibrium path, its limit load and stability.

What is derived stands in `derivations`; here it gets numbers.
"""
