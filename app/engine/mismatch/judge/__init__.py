"""Whether what is believed holds: on samples that no fit has seen, against terms without a name, with its intervals."""
