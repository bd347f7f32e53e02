"""How well problems are solved: measuring, storing and showing."""
