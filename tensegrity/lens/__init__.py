"""An acoustic lens: parallel chains of prisms whose prestrains focus their pulses at one point."""
