"""The independent components of a packing, each searched by itself."""
