"""Physics engines and Proxbench on the same scenes: what a simulated second costs, and how far the motion is off."""
