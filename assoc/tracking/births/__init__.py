"""How tracks begin: from one measurement, a tuple, or crossing bearings."""
