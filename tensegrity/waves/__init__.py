"""Linear and solitary waves of a chain: exact profiles, asymptotic forms, existence, spectra."""
