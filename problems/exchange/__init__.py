"""Problems by name: the catalogue, files, and what plugins offer."""
