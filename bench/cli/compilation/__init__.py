"""The command that compiles all kernels, in several processes."""
