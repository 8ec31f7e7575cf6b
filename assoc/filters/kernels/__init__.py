"""What filters compute, compiled."""
