"""Files of arrays: read without running code, written atomically."""
