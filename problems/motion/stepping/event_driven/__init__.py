"""The event-driven integrator: smooth motion between events that are located exactly."""
