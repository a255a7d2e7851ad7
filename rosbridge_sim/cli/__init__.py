"""The commands of the command line, and the tools behind them."""
