"""What the experiments with filters share: benchmark trajectories, runs, and the command line."""
