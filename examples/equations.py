"""Evaluates the equations for arrays: visibility as a function of samples and disparity.

Run: python examples/equations.py
"""

import numpy as np

from aosplan import normalized_visibility, required_samples, visibility

if __name__ == "__main__":
    dhat = np.array([0.1, 0.25, 0.5, 0.75, 1.0])
    side = np.array([2, 3, 5, 7, 10])
    print("V̂ of n x n samples (rows) at d̂ =", dhat)
    for n, row in zip(side, normalized_visibility(side[:, None], side[:, None], dhat), strict=True):
        print(f"{n:3d}", np.array2string(row, precision=3))
    print("V at p = 0.5, 7 x 7, d̂ = 1:", round(visibility(0.5, 7, 7, 1.0), 4))
    print("N for V̂ = 98 %:", required_samples("98%"))
