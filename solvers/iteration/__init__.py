"""Common parts of iterative methods: the loop, stopping, momentum and Anderson acceleration."""
