"""Plugins: solvers, problems and scenes from files and installed packages."""
