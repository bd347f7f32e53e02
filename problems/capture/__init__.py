"""Problems that are captured from the steps of physics engines, with what the engine itself set out to solve."""
