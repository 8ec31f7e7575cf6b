"""Reports of aircraft from files, and their cleaning."""
