"""Where the runs of a study are computed: in processes or on a cluster."""
