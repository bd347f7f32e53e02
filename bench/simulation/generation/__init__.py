"""Problems of the standard suites, made from steps of scenes."""
