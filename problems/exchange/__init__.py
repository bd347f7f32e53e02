"""Problems by name: the catalogue, problem files and plugins."""
