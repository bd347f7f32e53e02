"""How two runs differ: what became faster, slower, solved and unsolved."""
