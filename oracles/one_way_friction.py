"""Dry friction with a limit for each direction of slip: SciPy between events, enumeration of modes at events.

M a = F(t, q, v) + D^T f with a constant M and constant directions D.  f_i = -forward_i while D_i v > 0, and
f_i = backward_i while D_i v < 0.  A sticking element has D_i a = 0 and
-ratio_i forward_i <= f_i <= ratio_i backward_i.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.integrate import solve_ivp

TIGHT = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
SLACK = 1e-9  # violation that counts as rounding, relative to 1 + the largest force
# Slip speed and excess of a force at an event: slip begins, and limits are reached, at zero up to rounding.
REST = 1e-12


class OneWayFriction:
    """System with direction-dependent friction elements.

    Args:
        M: mass matrix, (n, n).
        force: (t, q, v) -> F, (n,).
        D: directions, (m, n).
        forward: friction limits for slip along the directions, (m,).
        backward: friction limits for slip against the directions, (m,).
        ratio: static over kinetic friction, (m,).
    """

    def __init__(self, M, force, D, forward, backward, ratio):
        self.M, self.force, self.D = np.asarray(M), force, np.asarray(D)
        self.forward, self.backward, self.ratio = map(np.asarray, (forward, backward, ratio))

    def solve(self, t, q, v, modes, ratio=1.0):
        """Return acceleration and friction forces for modes +1, -1 (slipping) and 0 (sticking).

        Slipping elements have `ratio` times their kinetic limit.
        """
        n, stuck = len(self.M), [i for i, mode in enumerate(modes) if mode == 0]
        f = np.where(np.array(modes) > 0, -ratio * self.forward, ratio * self.backward)
        f[stuck] = 0.0
        right = np.concatenate([self.force(t, q, v) + self.D.T @ f, np.zeros(len(stuck))])
        S = self.D[stuck]
        kkt = np.block([[self.M, -S.T], [S, np.zeros((len(stuck), len(stuck)))]])
        x = np.linalg.solve(kkt, right)
        f[stuck] = x[n:]
        return x[:n], f

    def margin(self, f, ratio=None):
        """Return the distance of each force to its nearer limit, by default static; negative outside."""
        ratio = self.ratio if ratio is None else ratio
        return np.minimum(f + ratio * self.forward, ratio * self.backward - f)

    def modes_at(self, t, q, v, modes, resting, breaking=None):
        """Select modes of the elements at rest that meet all conditions just after t.

        The static limits of all elements determine one motion.  Elements that slip in this motion have their
        kinetic limit from then on, and the modes are selected again, until no other element slips.
        """
        released = set() if breaking is None else {breaking}
        while True:
            static = [i in resting and i not in released for i in range(len(modes))]
            found = self._modes_within(np.where(static, self.ratio, 1.0), t, q, v, modes, resting, breaking)
            slipping = {i for i in resting if found[i] != 0}
            if slipping <= released:
                return found
            released |= slipping

    def _modes_within(self, ratio, t, q, v, modes, resting, breaking):
        """Select the modes for limits of `ratio` times the kinetic limits."""
        scale = 1.0 + np.abs(self.force(t, q, v)).max()
        for choice in product((0, 1, -1), repeat=len(resting)):
            trial = list(modes)
            for i, mode in zip(resting, choice, strict=True):
                trial[i] = mode
            if breaking is not None and trial[breaking] == 0:
                continue
            a, f = self.solve(t, q, v, trial, ratio)
            slip, inside = self.D @ a, self.margin(f, ratio)
            fits = [
                inside[i] >= -SLACK * scale if trial[i] == 0 else trial[i] * slip[i] >= -SLACK * scale
                for i in resting
            ]
            if all(fits):
                return trial
        raise RuntimeError("no modes")

    def run(self, q, v, times):
        """Return the states at the given times, and the number of events."""
        q, v, n = np.array(q, float), np.array(v, float), len(self.M)
        slip = self.D @ v
        resting = [i for i in range(len(slip)) if slip[i] == 0.0]
        modes = self.modes_at(times[0], q, v, [int(np.sign(s)) for s in slip], resting)
        out, t, events = [], times[0], 0
        for end in times:
            while t < end:
                watch = []
                for i, mode in enumerate(modes):

                    def event(t, y, i=i, mode=mode, modes=tuple(modes)):
                        if mode != 0:
                            return mode * self.D[i] @ y[n:] + REST
                        return self.margin(self.solve(t, y[:n], y[n:], modes)[1])[i] + REST

                    event.terminal, event.direction = True, -1.0
                    watch.append(event)

                def rate(t, y, modes=tuple(modes)):
                    return np.concatenate([y[n:], self.solve(t, y[:n], y[n:], modes)[0]])

                found = solve_ivp(
                    rate, (t, end), np.concatenate([q, v]), events=watch, max_step=0.02, **TIGHT
                )
                t, q, v = found.t[-1], found.y[:n, -1], found.y[n:, -1]
                if found.status != 1:
                    continue
                events += 1
                hit = next(i for i, at in enumerate(found.t_events) if len(at))
                stuck = [i for i, mode in enumerate(modes) if mode == 0]
                if modes[hit] != 0:  # projects v: the hit element and all sticking elements are at rest
                    S = self.D[[*stuck, hit]]
                    v = v - np.linalg.solve(self.M, S.T) @ np.linalg.solve(
                        S @ np.linalg.solve(self.M, S.T), S @ v
                    )
                modes = self.modes_at(t, q, v, modes, sorted({*stuck, hit}), hit if modes[hit] == 0 else None)
            out.append(np.concatenate([q, v]))
        return np.array(out), events
