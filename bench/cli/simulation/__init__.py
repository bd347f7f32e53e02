"""``proxbench simulate``, and what a simulation shows while it runs and when it is reported."""
