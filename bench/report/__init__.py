"""What results look like: tables, charts, pages."""
