"""Start, limit, supervise and end the child processes of cases."""
