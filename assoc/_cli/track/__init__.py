"""What only ``python -m assoc.track`` uses: its options, and plots as they come."""
