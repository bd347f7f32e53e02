"""Plan runs, and measure and judge their cases."""
