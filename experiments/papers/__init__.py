"""The five papers, each reproduced by one experiment."""
