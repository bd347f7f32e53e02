"""Sweeps that several threads or a device share: slabs and colours of contacts, a team of threads, and the sweeps."""
