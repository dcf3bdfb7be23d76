"""Derivatives of what a run computed: objectives, the pass backwards, and the chain rule to what
a user built."""
