"""The page of the comparison, from its lines."""
import numpy as np
from pathlib import Path

METHODS = ("quadrig", "pysindy", "gaussian process", "gradient boosting")
SHOWS = 1.2  # a channel is asked about where the declared model's held-out error is this many noise floors and more
TIE = 0.02

HEAD = """# Against what people use today

Written by `tests/peers/peers.py` ([how to run it](../tests/peers/README.md)). The same logs, the same declared polynomials, the same rows left out.

- {logs} runs of the independent generator, tuning seeds, even numbers. They hide one effect, two, one that the library does not know, or none. Each has a
  second run of the same rig on another schedule.
- {measured} recorded ones, of an RCbenchmark stand and of a lever rig. The other run of the lever rig is the same motor at the next supply voltage.

Each peer fits the residual of the declared polynomial on every channel. It is given:

- time, time since the last step and its direction, temperature;
- the regressor of the channel's relation and its first-order lags of 0.3, 3 and 30 s;
- where physics offers them, speed's rate, torque (for the thrust), charge drawn, voltage (for the speed).

* **pysindy** 2.0: STLSQ over all products of two standardised features; the threshold, or no term at all, by blocks of the training rows left out.
* **gaussian process** (scikit-learn): one length a feature, kernel by the likelihood of 120 rows, prediction from 500.
* **gradient boosting** (scikit-learn): 150 histogram trees of rate 0.05, at least 40 samples a leaf.

`quadrig` is `close-loop` with its default settings. Its general settings were tuned on even seeds too, though on other ones than these for the most part; the peers' thresholds and lengths are chosen within each run. Errors are in noise floors of the channel (the floor that `quadrig` reads off the run), on rows that no fit saw: five blocks of time and every second inner level. Channels on which the declared model's error is below {shows} floors have nothing to win; of them only the thrust was tried, and stands in a table of its own.
"""


def kinds(lines):
    return [(k, [line for line in lines if line["kind"] == k]) for k in ("one", "two", "unknown", "clean", "measured") if any(line["kind"] == k for line in lines)]


def errors(lines, where, asked):
    """Error over floor of each method on each asked channel; only channels that every method answered."""
    out = []
    for line in lines:
        for name, c in line["channels"].items():
            values = [c[m][where] for m in ("declared", *METHODS)]
            if c["floor"] and all(v is not None and np.isfinite(v) for v in values) and asked(c) and (something(c) or name == "thrust_n"):
                out.append([v / c["floor"] for v in values])
    return np.array(out).reshape(-1, 1 + len(METHODS))


def quartiles(v):
    low, mid, high = np.percentile(v, [25, 50, 75])
    return f"{mid:.2f} ({low:.2f}-{high:.2f})"


def something(c):
    return c["declared"][0] > SHOWS * c["floor"]


def nothing(c):
    return not something(c)


def error_table(lines, where, asked):
    text = "| runs | channels | declared | " + " | ".join(METHODS) + " |\n|" + " --- |" * (3 + len(METHODS)) + "\n"
    for kind, group in kinds(lines):
        e = errors(group, where, asked)
        if len(e):
            text += f"| {kind} | {len(e)} | " + " | ".join(quartiles(e[:, j]) for j in range(1 + len(METHODS))) + " |\n"
    return text


def duel(lines, where, asked):
    text = "| runs | " + " | ".join(f"against {m}" for m in METHODS[1:]) + " |\n|" + " --- |" * len(METHODS) + "\n"
    for kind, group in kinds(lines):
        e = errors(group, where, asked)
        if not len(e):
            continue
        cells = []
        for j in range(2, 1 + len(METHODS)):
            ratio = e[:, 1] / e[:, j]
            won, lost = int((ratio < 1 - TIE).sum()), int((ratio > 1 + TIE).sum())
            cells.append(f"{won} won, {len(e) - won - lost} level, {lost} lost")
        text += f"| {kind} | " + " | ".join(cells) + " |\n"
    return text


def names(lines):
    text = "| runs | n | quadrig: hidden effect named (all of them) | quadrig: verdict | pysindy: terms on the channels asked about |\n| --- | --- | --- | --- | --- |\n"
    for kind, group in kinds(lines):
        hits = sum(bool(line["hidden"]) and set(line["hidden"]) <= set(line["named"]) for line in group)
        verdicts = [line["verdict"] for line in group]
        said = ", ".join(f"{verdicts.count(v)} {v}" for v in sorted(set(verdicts)))
        terms = [len(line["terms"][c]) for line in group for c, d in line["channels"].items() if something(d) or kind == "clean"]
        named = "-" if kind in ("clean", "measured", "unknown") else f"{hits} of {len(group)}"
        text += f"| {kind} | {len(group)} | {named} | {said} | {quartiles(terms) if terms else '-'} |\n"
    return text


def losses(lines, where):
    """The channels on which the best peer beats quadrig most."""
    found = []
    for line in lines:
        for name, c in line["channels"].items():
            values = {m: c[m][where] for m in METHODS if c[m][where] is not None}
            if something(c) and len(values) == len(METHODS):
                best = min(METHODS[1:], key=values.get)
                found.append((values["quadrig"] / values[best], line, name, best, c))
    found.sort(key=lambda f: -f[0])
    text = "| run | hidden | channel | declared | quadrig (named) | best peer |\n| --- | --- | --- | --- | --- | --- |\n"
    for ratio, line, name, best, c in found[:10]:
        if ratio > 1 + TIE:
            f = c["floor"]
            text += f"| {line['log']} | {', '.join(line['hidden']) or line['kind']} | {name} | {c['declared'][where] / f:.2f} | {c['quadrig'][where] / f:.2f} ({', '.join(line['named']) or '-'}) | {c[best][where] / f:.2f} {best} |\n"
    return text


def write(lines, page):
    measured = sum(line["kind"] == "measured" for line in lines)
    seconds = lambda m: quartiles([line["seconds"][m] for line in lines])
    text = HEAD.format(logs=len(lines) - measured, measured=measured, shows=SHOWS)
    text += "\n## Held out of the same run\n\nMedian (quartiles) over the channels.\n\n" + error_table(lines, 0, something)
    text += f"\nChannel by channel (level: within {TIE:.0%}):\n\n" + duel(lines, 0, something)
    text += "\n## On the other run of the same rig\n\nNothing refitted; errors of the whole other run.\n\n" + error_table(lines, 1, something)
    text += "\n" + duel(lines, 1, something)
    text += "\n## Where nothing is left to explain\n\nRuns whose thrust the declared model predicts within " + f"{SHOWS} floors: a correction can only do harm there.\n\n" + error_table(lines, 0, nothing) + "\nOn the other run:\n\n" + error_table(lines, 1, nothing)
    text += "\n## Names\n\nA Gaussian process and boosted trees name nothing. The sparse regression gives an equation in the features; how many terms it keeps says how readable it is. `quadrig` may say `unattributed` or `ambiguous`.\n\n" + names(lines)
    text += "\n## Time\n\nProcessor seconds a run on one core, all folds, median (quartiles), channels with something to explain and the thrust (`quadrig`: all); the files are read and written in `quadrig`'s only.\n\n| " + " | ".join(METHODS) + " |\n|" + " --- |" * len(METHODS) + "\n| " + " | ".join(seconds(m) for m in METHODS) + " |\n"
    text += "\n## Where a peer wins\n\nThe ten channels with the largest loss, held out of the same run (errors in noise floors):\n\n" + losses(lines, 0)
    text += "\nAnd on the other run:\n\n" + losses(lines, 1)
    Path(page).write_text(text, encoding="utf-8")
