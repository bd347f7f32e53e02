"""Reports of results: tables, charts, and their files."""
