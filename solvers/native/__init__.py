"""Solvers in any language: shared libraries with a C interface, and executables that communicate over pipes."""
