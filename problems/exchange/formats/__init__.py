"""Files of other programs, and plain ones that a few lines of any program write, read as contact problems."""
