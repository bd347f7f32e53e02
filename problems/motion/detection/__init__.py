"""Which bodies are close enough to touch."""
