"""Run the command line as ``python -m proxbench``."""

from .bench.cli.main import main

if __name__ == "__main__":
    main()
