"""The figures and tables of the thesis again: its method, the optimum, and the bound of both."""
