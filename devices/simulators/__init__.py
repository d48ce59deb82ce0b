"""Simulated devices: a motion's tracker positions as the bytes that a real device would send, over real ports."""
