"""Parts of the experiment on the clustering time window."""
