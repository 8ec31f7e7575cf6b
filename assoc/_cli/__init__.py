"""Shared parts of the programs: options, tables, progress, signals, exit codes."""
