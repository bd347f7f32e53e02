"""Reading and writing of FCLIB files, the exchange format for frictional contact problems."""
