"""The console commands, one file a group. Each imports what it needs inside its function, so that `--help` is quick."""
