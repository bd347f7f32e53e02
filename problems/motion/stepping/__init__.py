"""How a system moves: steps of fixed and variable size, and the event-driven reference."""
