"""Physics engines and Proxbench on the same scenes: the cost of a simulated second, and the error of the motion."""
