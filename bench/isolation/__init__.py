"""Child processes of cases: start, limit, supervise and end them."""
