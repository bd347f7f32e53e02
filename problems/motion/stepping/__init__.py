"""Time integration of systems: fixed and variable steps, and the event-driven reference."""
