"""Reports of aircraft and ships from files, and their cleaning."""
