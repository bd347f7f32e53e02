"""``python -m proxbench.solvers.native`` prints the folder of ``proxbench.h``."""

from .structures import include_folder

print(include_folder())
