"""Kernels of elasticity on quadratic tetrahedra: blocks of 3 x 3 for each pair of nodes."""

from __future__ import annotations

import numpy as np
from numba import njit

from spindle_fem.model.mesh.kernels import FAST


@njit(**FAST)
def add_elements(
    points, elements, gradients, values, weights, constants, rise, starts, columns, blocks, expansion, turning
):  # fmt: skip
    """Add the stiffness of every element to full block rows, and its loads to the nodes; inverted elements.

    ``constants`` (n_elements, 4) are Lamé's Λ and μ, the stress that holds back a kelvin, and the density;
    ``blocks`` (n_entries, 3, 3), ``expansion`` (n, 3) by the rise of temperature at the nodes, ``turning``
    (n, 3) of a turn about z at 1 rad/s. Tables are those of the reference element.
    """
    n = values.shape[1]
    jacobian, cofactor, slope = np.empty((3, 3)), np.empty((3, 3)), np.empty((n, 3))
    products = np.empty((n, n, 3, 3))
    block = np.empty((3, 3))
    inverted = 0
    for e in range(elements.shape[0]):
        first, shear, thermal, density = constants[e]
        products[:] = 0.0
        turned = False
        for q in range(weights.size):
            jacobian[:] = 0.0
            x, y, warmer = 0.0, 0.0, 0.0
            for i in range(n):
                node = elements[e, i]
                warmer += values[q, i] * rise[node]
                x += values[q, i] * points[node, 0]
                y += values[q, i] * points[node, 1]
                for a in range(3):
                    for k in range(3):
                        jacobian[a, k] += points[node, a] * gradients[q, i, k]
            for a in range(3):
                b, c = (a + 1) % 3, (a + 2) % 3
                for k in range(3):
                    second, third = (k + 1) % 3, (k + 2) % 3
                    cofactor[a, k] = (
                        jacobian[b, second] * jacobian[c, third] - jacobian[b, third] * jacobian[c, second]
                    )
            determinant = 0.0
            for k in range(3):
                determinant += jacobian[0, k] * cofactor[0, k]
            turned |= determinant <= 0.0
            # gradients in space times the determinant
            for i in range(n):
                for a in range(3):
                    slope[i, a] = 0.0
                    for k in range(3):
                        slope[i, a] += cofactor[a, k] * gradients[q, i, k]
            scale, weight = weights[q] / determinant, weights[q] * determinant
            for i in range(n):
                node = elements[e, i]
                for a in range(3):
                    expansion[node, a] += thermal * warmer * weights[q] * slope[i, a]
                turning[node, 0] += density * weight * values[q, i] * x
                turning[node, 1] += density * weight * values[q, i] * y
                for j in range(i, n):
                    for a in range(3):
                        for b in range(3):
                            products[i, j, a, b] += scale * slope[i, a] * slope[j, b]
        inverted += turned
        for i in range(n):
            for j in range(i, n):
                trace = shear * (products[i, j, 0, 0] + products[i, j, 1, 1] + products[i, j, 2, 2])
                for a in range(3):
                    for b in range(3):
                        block[a, b] = first * products[i, j, a, b] + shear * products[i, j, b, a]
                    block[a, a] += trace
                one, other = elements[e, i], elements[e, j]
                place = starts[one]
                while columns[place] != other:
                    place += 1
                for a in range(3):
                    for b in range(3):
                        blocks[place, a, b] += block[a, b]
                if i != j:
                    place = starts[other]
                    while columns[place] != one:
                        place += 1
                    for a in range(3):
                        for b in range(3):
                            blocks[place, a, b] += block[b, a]
    return inverted


@njit(**FAST)
def multiply_blocks(low, high, starts, columns, blocks, vectors, out):
    """``out = A vectors`` on a range of rows of blocks; vectors (n, 3)."""
    for i in range(low, high):
        x, y, z = 0.0, 0.0, 0.0
        for place in range(starts[i], starts[i + 1]):
            j = columns[place]
            u, v, w = vectors[j, 0], vectors[j, 1], vectors[j, 2]
            x += blocks[place, 0, 0] * u + blocks[place, 0, 1] * v + blocks[place, 0, 2] * w
            y += blocks[place, 1, 0] * u + blocks[place, 1, 1] * v + blocks[place, 1, 2] * w
            z += blocks[place, 2, 0] * u + blocks[place, 2, 1] * v + blocks[place, 2, 2] * w
        out[i, 0], out[i, 1], out[i, 2] = x, y, z
