"""The EKF with fuzzy inference: the paper's rules, tuned rules, fixed filters and an IMM on the same manoeuvres."""
