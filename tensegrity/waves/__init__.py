"""Exact solitary waves of a chain, and the asymptotic forms that they are compared with."""
