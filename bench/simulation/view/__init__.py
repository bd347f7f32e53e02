"""Tables, chart and live summary of a simulation."""
