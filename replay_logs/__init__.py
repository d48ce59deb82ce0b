"""What was captured, kept and given back: takes of raw bytes and samples, and tracks as plain tables."""
