"""Work–precision studies of simulations: what an accuracy of the motion costs, over steps, tolerances and solvers."""
