"""The kernels: sweeps over the Delassus matrix or the factors, contact by contact."""
