"""How a simulation is shown: tables, a chart, and a live summary."""
