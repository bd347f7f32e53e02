"""Bodies with their masses and force directions: balls, fixed surfaces, and systems given by functions."""
