"""Files of other programs and instruments: what is read from them, and written for them."""
