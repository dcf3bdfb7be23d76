"""Theorems about folds and waves, in ball arithmetic."""
