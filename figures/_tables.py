"""Tables made of rows."""

import numpy as np


def arrays(rows):
    """Rows {column: value} of equal keys as {column: array}."""
    return {key: np.array([row[key] for row in rows]) for key in rows[0]}
