"""What iterative methods share: the loop, stopping, momentum and Anderson acceleration."""
