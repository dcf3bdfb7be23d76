"""Theorems about folds and travelling waves, proved in ball arithmetic: `prove`, `verify`."""
