"""What the command lines share: options, tables, progress, signals, exit codes."""
