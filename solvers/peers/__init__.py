"""External solvers, called unchanged; the extra ``peers`` installs their libraries."""
