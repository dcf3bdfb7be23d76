"""Runs of scenes: the step, the march under watch, records, files, and going on from them."""
