"""Trackers: what they send, how it is read, and the samples and frames that come of it."""
