"""How tracks begin: priors of new targets, from one measurement, a tuple, or crossing bearings."""
