"""What moves: mechanical systems given by functions, and balls among surfaces."""
