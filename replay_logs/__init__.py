"""Takes: everything a session captured, kept, read again and played back as a device."""
