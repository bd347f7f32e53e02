"""Results on disk, and as data frames."""
