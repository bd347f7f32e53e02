"""Layout of tables for terminals and pages, and files of a report."""
