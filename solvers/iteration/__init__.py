"""What iterations share: the loop, when to stop, momentum, safeguards and acceleration."""
