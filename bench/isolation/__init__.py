"""Processes of their own for cases: started, limited, supervised and ended."""
