"""Stored results: files, records and data frames."""
