"""The session: time, threads, windows, files and commands. It composes the other packages."""
