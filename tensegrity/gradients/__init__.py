"""Gradients of runs: objectives, the discrete adjoint, and the chain rule to the arguments that a
scene is built from."""
