"""The frozen problems of the standard suites, as compressed arrays."""
