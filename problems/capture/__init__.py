"""Problems captured from the steps of physics engines, with the model that the engine solves."""
