"""The shortfall of samples over independent slices, computed from its definition as a sum over
pairs.
"""

import numpy as np


def slices_shortfall(points, layers, altitude_m):
    """K = ΣΣ Cov/(N² p T), with Cov = Π (q² + D q τ) - Π q² over slices.  Coordinates of points are
    along the axes of the occluders.
    """
    points = np.asarray(points, dtype=float)
    x, y = np.abs(points[:, None] - points[None, :]).transpose(2, 0, 1)
    both, clear = np.ones(x.shape), 1.0
    for layer in layers:
        height = 0.5 * (layer.bottom_m + layer.top_m)
        reach = layer.occluder_size_m * altitude_m / height
        tau = np.maximum(1.0 - x / reach, 0.0) * np.maximum(1.0 - y / reach, 0.0)
        q = 1.0 - layer.density
        both *= q * q + layer.density * q * tau
        clear *= q
    return float((both - clear * clear).mean()) / (clear * (1.0 - clear))
