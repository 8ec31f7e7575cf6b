"""Records that trackers are made of and remember; they know no other file of `assoc.tracking`."""
