"""Solvers, problems and scenes from elsewhere: known as data here, made and run in processes of their own."""
