"""The commands ``proxbench simulate``, ``statics`` and ``engines``."""
