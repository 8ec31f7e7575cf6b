"""What the library asks of the machine: compiler, clock, memory, processes, signals."""
