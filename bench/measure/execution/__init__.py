"""Where the cases of a run are measured: in this process, or in parts wherever an executor has workers."""
