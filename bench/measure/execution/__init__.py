"""Execute the plan of a run in this process, or on the workers of an executor."""
