"""``proxbench simulate``: its command, interruption, and output."""
