"""Loops over the steps of a recording in which something switches, for :mod:`.switching_model`."""

from __future__ import annotations

import numpy as np
from numba import njit

from spindle_fem.model.mesh.kernels import OPTIONS


@njit(**OPTIONS)
def states(advance, loss, group, entering, begins, level, sizes):
    """States that a course leads to (T, n), slopes by the sizes (T, l, n), at the ends of the steps."""
    steps, n = entering.shape
    levels = len(sizes)
    states, slopes = np.zeros((steps, n)), np.zeros((steps, levels, n))
    state, slope = np.zeros(n), np.zeros((levels, n))
    for t in range(steps):
        if begins[t]:
            state[:] = 0.0
            slope[:] = 0.0
        a, b = advance[group[t]], loss[group[t]]
        now = level[t] - 1
        for k in range(levels):
            changed = a @ slope[k]
            if now >= 0:
                changed = changed - sizes[now] * (b @ slope[k])
            if k == now:
                changed = changed + entering[t] - b @ state
            slope[k] = changed
        entered = sizes[now] * (entering[t] - b @ state) if now >= 0 else 0.0 * state
        state = a @ state + entered
        states[t], slopes[t] = state, slope
    return states, slopes


@njit(**OPTIONS)
def gains(known, variance, slopes, kept, slow):
    """Gains (T, c, m) and variances (T, c) of the innovations.

    Readings of one step are taken one after the other; m are the slow errors, then the coordinates.
    """
    steps, channels = known.shape
    own = slopes.shape[2]
    m = channels + own
    gain, total = np.zeros((steps, channels, m)), np.ones((steps, channels))
    covariance = np.zeros((m, m))
    for j in range(channels):
        covariance[j, j] = slow[j]
    for j in range(channels, m):
        covariance[j, j] = 1.0
    row = np.zeros(m)
    for t in range(steps):
        for j in range(channels):
            for i in range(m):
                covariance[j, i] *= kept[t, j]
            for i in range(m):
                covariance[i, j] *= kept[t, j]
            covariance[j, j] += slow[j] * (1.0 - kept[t, j] ** 2)
        for j in range(channels):
            if not known[t, j]:
                continue
            for i in range(m):
                value = covariance[i, j]
                for k in range(own):
                    value += covariance[i, channels + k] * slopes[t, j, k]
                row[i] = value
            spread = variance[t, j] + row[j]
            for k in range(own):
                spread += slopes[t, j, k] * row[channels + k]
            total[t, j] = spread
            for i in range(m):
                gain[t, j, i] = row[i] / spread
            for i in range(m):
                for k in range(m):
                    covariance[i, k] -= gain[t, j, i] * row[k]
    return gain, total


@njit(**OPTIONS)
def innovations(values, known, slopes, kept, gain, total):
    """Innovations of values (T, c): less their mean given the past, over its standard deviation."""
    steps, channels = values.shape
    own = slopes.shape[2]
    mean = np.zeros(channels + own)
    found = np.zeros_like(values)
    for t in range(steps):
        for j in range(channels):
            mean[j] *= kept[t, j]
        for j in range(channels):
            if not known[t, j]:
                continue
            apart = values[t, j] - mean[j]
            for k in range(own):
                apart -= slopes[t, j, k] * mean[channels + k]
            found[t, j] = apart / np.sqrt(total[t, j])
            for i in range(channels + own):
                mean[i] += gain[t, j, i] * apart
    return found


@njit(**OPTIONS)
def follow(
    residual, known, slopes, kept, gain, total, advance, loss, group, entering, begins, reads, outputs,
    log_moves, condition, sizes, courses, after,
):  # fmt: skip
    """Follow the most likely courses; see :meth:`ReadingFilter.courses`."""
    steps, channels = residual.shape
    own, n = slopes.shape[2], entering.shape[1]
    m = channels + own
    levels = len(sizes)
    parent = np.zeros((steps, courses), dtype=np.int32)
    chosen = np.zeros((steps, courses), dtype=np.int8)
    most = levels * courses
    # For every course: state, mean of the nuisances, weight, likelihood, its level, its last change (the step
    # times the number of levels, and the level before it), the step of that before, its past.
    state, mean = np.zeros((most, n)), np.zeros((most, m))
    weight, likelihood = np.zeros(most), np.zeros(most)
    level, last, before = np.zeros(most, np.int8), np.zeros(most, np.int64), np.zeros(most, np.int64)
    past = np.zeros((most, after), np.int8)
    next_state, next_mean = np.zeros((most, n)), np.zeros((most, m))
    next_weight, next_likelihood = np.zeros(most), np.zeros(most)
    next_level, next_last, next_before = (
        np.zeros(most, np.int8),
        np.zeros(most, np.int64),
        np.zeros(most, np.int64),
    )
    origin = np.zeros(most, np.int64)
    joined = np.zeros(most)
    probability = np.zeros(steps)
    moved, taken = np.zeros(n), np.zeros(n)
    count = 1
    last[0], before[0] = -1, -2
    for t in range(steps):
        a, b, read = advance[group[t]], loss[group[t]], outputs[reads[t]]
        q = condition[t]
        children = 0
        for h in range(count):
            for i in range(n):
                moved[i], taken[i] = 0.0, 0.0
                for k in range(n):
                    moved[i] += a[i, k] * state[h, k]
                    taken[i] += b[i, k] * state[h, k]
            for s in range(levels):
                c = children
                step = log_moves[q, level[h], s]
                next_level[c] = s
                next_last[c] = last[h] if s == level[h] else t * levels + level[h]
                next_before[c] = before[h] if s == level[h] else last[h] // levels
                for i in range(n):
                    if begins[t]:
                        next_state[c, i] = 0.0
                    else:
                        next_state[c, i] = moved[i]
                        if s > 0:
                            next_state[c, i] -= sizes[s] * taken[i]
                    if s > 0:
                        next_state[c, i] += sizes[s] * entering[t, i]
                for i in range(m):
                    next_mean[c, i] = mean[h, i] * kept[t, i] if i < channels else mean[h, i]
                gained = 0.0
                for j in range(channels):
                    if not known[t, j]:
                        continue
                    apart = residual[t, j] - next_mean[c, j]
                    for i in range(n):
                        apart -= read[j, i] * next_state[c, i]
                    for k in range(own):
                        apart -= slopes[t, j, k] * next_mean[c, channels + k]
                    gained -= 0.5 * apart**2 / total[t, j]
                    for i in range(m):
                        next_mean[c, i] += gain[t, j, i] * apart
                next_weight[c] = weight[h] + step + gained
                next_likelihood[c] = likelihood[h] + gained
                origin[c] = h
                children += 1
        # Join those that agree on what is on, on the last two changes and on the level between them.
        order = np.argsort(-next_weight[:children])
        top = next_weight[order[0]]
        kept_courses = 0
        selected = np.empty(courses, np.int64)
        for position in range(children):
            c = order[position]
            twin = -1
            for other in range(kept_courses):
                d = selected[other]
                if (
                    next_level[d] == next_level[c]
                    and next_last[d] == next_last[c]
                    and next_before[d] == next_before[c]
                ):
                    twin = other
                    break
            if twin >= 0:
                joined[selected[twin]] += np.exp(next_weight[c] - top)
            elif kept_courses < courses and next_weight[c] > top - 40.0:
                selected[kept_courses] = c
                joined[c] = np.exp(next_weight[c] - top)
                kept_courses += 1
        spare = np.empty((kept_courses, after), np.int8)
        for k in range(kept_courses):
            c = selected[k]
            h = origin[c]
            parent[t, k], chosen[t, k] = h, next_level[c]
            for i in range(after):
                spare[k, i] = past[h, i]
            spare[k, t % after] = next_level[c]
        if kept_courses == 0:
            # no course has a likelihood that is a number
            return np.zeros(steps, np.int64), probability, -np.inf, -np.inf
        whole = 0.0
        for k in range(kept_courses):
            c = selected[k]
            state[k] = next_state[c]
            mean[k] = next_mean[c]
            weight[k] = top + np.log(joined[c])
            likelihood[k] = next_likelihood[c]
            level[k], last[k], before[k] = next_level[c], next_last[c], next_before[c]
            past[k] = spare[k]
            whole += joined[c]
        count = kept_courses
        # States long ago are determined by the remaining courses.
        if t >= after - 1:
            old = (t + 1) % after
            share = 0.0
            for k in range(count):
                if past[k, old] > 0:
                    share += joined[selected[k]]
            probability[t - after + 1] = share / whole
    top = weight[:count].max()
    shares = np.exp(weight[:count] - top)
    evidence = top + np.log(shares.sum())
    for t in range(max(0, steps - after + 1), steps):
        share = 0.0
        for k in range(count):
            if past[k, t % after] > 0:
                share += shares[k]
        probability[t] = share / shares.sum()
    best = int(np.argmax(weight[:count]))
    course = np.zeros(steps, np.int64)
    k = best
    for t in range(steps - 1, -1, -1):
        course[t] = chosen[t, k]
        k = parent[t, k]
    return course, probability, evidence, likelihood[best]
