"""Ratios against peers, each measured side by side with ours in one run."""
