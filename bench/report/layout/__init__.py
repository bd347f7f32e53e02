"""How tables are laid out for a terminal and for pages, and how files of a report are written."""
