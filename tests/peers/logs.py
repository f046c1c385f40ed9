"""Reading a rig log, the declared polynomials, the features that the peers are given, and the rows that are left out.

Rules of `heldout_rms`: five contiguous blocks of time, and every second interior level of the command, each left out in turn.
"""
import csv
import numpy as np

SPEEDS = ("rpm", "rpm_beam", "rpm_opto", "rpm_hall", "rpm_encoder")
LAGS_S = (0.3, 3.0, 30.0)
DEGREE = {"thrust_n": 2, "torque_nm": 2, "current_a": 3, "voltage_v": 0}


def read(path):
    with open(path, encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return {n: np.array([float(r[n]) if r[n] else np.nan for r in rows]) for n in rows[0]}


def channels(log):
    return [c for c in (*SPEEDS, *DEGREE) if c in log and np.isfinite(log[c]).sum() > 60]


class Run:
    """A log with its consensus speed and everything bridged."""

    def __init__(self, path):
        self.log = read(path)
        self.t = self.log["t_s"]
        self.pulse = self.bridged("pulse_us")
        speeds = [self.log[n] for n in SPEEDS if n in self.log]
        median = np.nanmedian(np.array(speeds), axis=0)
        self.rpm = self.fill(median) / 1000
        self.current, self.voltage = self.bridged("current_a"), self.bridged("voltage_v")
        self.torque, self.temp = self.bridged("torque_nm"), self.bridged("temp_c")
        dt = np.gradient(self.t)
        self.charge = None if self.current is None else np.cumsum(self.current * dt) / 3600
        drive = self.pulse if self.pulse is not None else self.rpm
        change = np.abs(np.diff(drive, prepend=drive[0])) > (0.5 if self.pulse is not None else 0.02 * self.rpm.max())
        last = np.maximum.accumulate(np.where(change, np.arange(len(self.t)), 0))
        self.since = self.t - self.t[last]
        self.direction = np.sign(np.diff(drive, prepend=drive[0]))[last]

    def fill(self, v):
        good = np.isfinite(v)
        return np.interp(self.t, self.t[good], v[good])

    def bridged(self, name):
        return self.fill(self.log[name]) if name in self.log and np.isfinite(self.log[name]).any() else None

    def lagged(self, x, tau):
        out, state = np.empty_like(x), x[0]
        keep = np.exp(-np.diff(self.t, prepend=self.t[0]) / tau)
        for i, (v, k) in enumerate(zip(x, keep)):
            state = k * state + (1 - k) * v
            out[i] = state
        return out

    def features(self, channel):
        """What a peer may explain a channel's residual by: what the channel's relation and the library's effects may look at."""
        out = {"t": self.t, "time_since_step": self.since, "direction": self.direction, "temp_c": self.temp}
        if channel in SPEEDS:
            drive = {"pulse_us": self.pulse}
            out |= {"voltage_v": self.voltage, "charge": self.charge}
        elif channel == "voltage_v":
            drive = {"current_a": self.current}
            out["charge"] = self.charge
        else:
            drive = {"rpm": self.rpm}
            out["rpm_rate"] = np.gradient(self.rpm, self.t)
            out["torque_nm"] = self.torque if channel == "thrust_n" else None
        for name, x in drive.items():
            if x is not None:
                out[name] = x
                out |= {f"{name} lagged {tau} s": self.lagged(x, tau) for tau in LAGS_S}
        kept = {n: v for n, v in out.items() if v is not None and np.ptp(v) > 0}
        return list(kept), np.column_stack(list(kept.values()))

    def start_pulse(self):
        turning = self.rpm > 0.01 * self.rpm.max()
        on = self.pulse[turning].min()
        off = self.pulse[~turning & (self.pulse < on)]
        return 0.5 * (on + off.max()) if len(off) else on - 0.5

    def declared(self, channel, start):
        """Columns of the declared polynomial."""
        if channel in SPEEDS:
            if self.pulse is None:
                return np.ones((len(self.t), 1))
            x = (self.pulse - 1000) / 1000
            return np.column_stack([x**k for k in range(4)]) * (self.pulse >= start)[:, None]
        return np.column_stack([self.rpm**k for k in range(DEGREE[channel] + 1)])

    def blocks(self):
        share = (self.t - self.t[0]) / (self.t[-1] - self.t[0])
        return np.minimum((5 * share).astype(int), 4)

    def folds(self):
        block = self.blocks()
        out = [block == k for k in range(5)]
        drive, near = (self.pulse, 3.0) if self.pulse is not None else (self.rpm, 0.015 * self.rpm.max())
        level = np.full(len(self.t), -1)
        edges = np.flatnonzero(np.abs(np.diff(drive)) > (0.5 if self.pulse is not None else 0.01 * self.rpm.max())) + 1
        holds = [(drive[a:b].mean(), a, b) for a, b in zip([0, *edges], [*edges, len(drive)]) if b - a >= 6]
        number, anchor = -1, -np.inf
        for value, a, b in sorted(holds):
            if value - anchor > near:
                number, anchor = number + 1, value
            level[a:b] = number
        odd = (level > 0) & (level < number) & (level % 2 == 1)
        return out + [odd] if odd.any() else out
