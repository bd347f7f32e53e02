"""What iterative methods share: the loop, stopping, momentum, relaxation and Anderson acceleration."""
