"""The modified EKF for a 3-D radar: the paper's own setting, and a benchmark where the modification matters."""
