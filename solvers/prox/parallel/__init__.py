"""Sweeps that several threads share: colours of contacts, a team of threads, and sweeps colour by colour."""
