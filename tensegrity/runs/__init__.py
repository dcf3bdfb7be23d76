"""Runs of scenes: choice of the step, march, records, files, and resumption from checkpoints."""
