"""Closing the loop against what people use today, on the same logs.

usage: peers.py run|refresh --quadrig PROGRAM --blind PROGRAM [--data FOLDER] [--lines FILE.jsonl]
       peers.py page [--lines FILE.jsonl] [--page docs/peers.md]

`run` writes one line a log and resumes where it was interrupted; `refresh` takes the peers' figures from the lines and asks
`quadrig` alone again; `page` writes the page. The setting, the pinned packages and the figures stand in README.md and
docs/peers.md.
"""
import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"  # times are those of one core

import argparse, json, resource, subprocess, sys, tempfile, time, warnings
from pathlib import Path
import numpy as np
from logs import Run, channels
from methods import PEERS
from page import SHOWS, write

warnings.filterwarnings("ignore")
# tuning seeds only (even ones); nobody chose them: the first of each kind from 200 and from 1 000 200 on
SEEDS = [s for s in range(200, 260, 2) if s // 2 % 10 not in (4, 5)]
SEEDS = [s for k, s in enumerate(SEEDS) for s in ([s] if k % 4 else [s, 1_000_200 + k // 2])]


def quadrig(program, log, others, folder):
    """The verdict, and its processor time in seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    words = [program, "close-loop", str(log), "-o", str(folder / "closed"), "--json"]
    for other in others:
        words += ["--validate", str(other)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return json.loads(done.stdout), after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def rms(parts):
    values = np.concatenate(parts) if parts else np.array([])
    return float(np.sqrt(np.mean(values**2))) if len(values) else None


def rival(make, run, other, channel, start):
    """Errors of the declared polynomial with a peer on its residual: held out, and on the other run; and the terms it names."""
    names, x = run.features(channel)
    y, base, block = run.log[channel], run.declared(channel, start), run.blocks()
    measured = np.isfinite(y)

    def learnt(rows):
        line = np.linalg.lstsq(base[rows], y[rows], rcond=None)[0]
        return line, make(x[rows], y[rows] - base[rows] @ line, block[rows], names)

    errors = []
    for out in run.folds():
        line, model = learnt(measured & ~out)
        rows = measured & out
        if rows.any():
            errors.append(y[rows] - base[rows] @ line - model.predict(x[rows]))
    line, model = learnt(measured)
    elsewhere = None
    if other is not None and channel in other.log and len(other.features(channel)[0]) == len(names):
        rows = np.isfinite(other.log[channel])
        guess = other.declared(channel, start)[rows] @ line + model.predict(other.features(channel)[1][rows])
        elsewhere = rms([other.log[channel][rows] - guess])
    return rms(errors), elsewhere, getattr(model, "named", None)


def work(program, name, log, other, truth, known=None):
    """One line; the peers' figures from a known one."""
    with tempfile.TemporaryDirectory() as folder:
        verdict, seconds = quadrig(program, log, [other] if other else [], Path(folder))
    run, second = Run(log), Run(other) if other else None
    start = run.start_pulse() if run.pulse is not None else 0.0
    line = {"log": name, **truth, "rows": len(run.t), "verdict": verdict["verdict"], "named": [e["id"] for e in verdict["effects"]]}
    line |= {"seconds": {"quadrig": seconds}, "channels": {}, "terms": {}}
    elsewhere = (verdict.get("validation") or [{}])[0].get("channels", {})
    for c in channels(run.log):
        own = verdict["channels"][c]
        # channels with nothing to win say one thing only, how much harm a correction does: the thrust stands for them
        if own["before"]["heldout_rms"] < SHOWS * own["noise_floor_rms"] and c != "thrust_n":
            continue
        line["channels"][c] = {
            "floor": own["noise_floor_rms"],
            "declared": [own["before"]["heldout_rms"], elsewhere.get(c, {}).get("before")],
            "quadrig": [own["after"]["heldout_rms"], elsewhere.get(c, {}).get("after")],
        }
    if known:
        line["channels"] = {c: f for c, f in line["channels"].items() if c in known["channels"]}
        for c, figures in line["channels"].items():
            figures |= {peer: known["channels"][c][peer] for peer in PEERS}
        return line | {"terms": known["terms"], "seconds": known["seconds"] | line["seconds"]}
    for peer, make in PEERS.items():
        started = time.process_time()
        for c in line["channels"]:
            held, there, terms = rival(make, run, second, c, start)
            line["channels"][c][peer] = [held, there]
            if terms is not None:
                line["terms"][c] = terms
        line["seconds"][peer] = time.process_time() - started
    return line


def truth_of(text):
    """Kind and effects of a dumped scenario."""
    words = next(line for line in text.splitlines() if line.startswith("hidden")).split(" ", 1)[1]
    kind = words.split("(")[0].lower()
    shown = [line.split(" shown by ")[1].split(",")[0] for line in text.splitlines() if " shown by " in line]
    return {"kind": kind, "hidden": [w.strip(' "') for w in words.rstrip(")").split("(")[1].split(",")] if "(" in words else [], "shown": shown}


def cases(a, folder):
    """Every log with its other run and what is known of it."""
    sets = {"spitz-esc-test/original": "Log_*.csv", "lever-rig-10x45/tidy": "robbe*.csv"} if a.data else {}
    for place, pattern in sets.items():
        imported = []
        for file in sorted((Path(a.data) / "rig" / place).glob(pattern)):
            imported.append(folder / f"{file.stem}.csv")
            subprocess.run([a.quadrig, "import", str(file), "-o", str(imported[-1])], check=True, capture_output=True)
        # the stand's three logs are three motors; the lever rig is one motor at four voltages
        others = imported[1:] + imported[:1] if place.startswith("lever") else [None] * len(imported)
        for log, other in zip(imported, others):
            yield log.stem, log, other, {"kind": "measured", "hidden": [], "shown": []}
    for seed in SEEDS:
        subprocess.run([a.blind, "--dump", str(seed), str(folder)], check=True)
        truth = truth_of((folder / f"{seed}.truth.txt").read_text())
        yield f"seed {seed}", folder / f"{seed}.csv", folder / f"{seed}.validate.csv", truth


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("what", choices=("run", "refresh", "page"))
    for flag in ("--quadrig", "--blind", "--data"):
        ap.add_argument(flag)
    ap.add_argument("--part", default="0/1", help="K/N: only every N-th log from the K-th on, to share the work")
    ap.add_argument("--lines", default="peers.jsonl")
    ap.add_argument("--page", default="docs/peers.md")
    a = ap.parse_args()
    lines = Path(a.lines)
    known = [json.loads(line) for line in lines.read_text().splitlines()] if lines.exists() else []
    if a.what == "page":
        return write(known, a.page)
    if not a.quadrig or not a.blind:
        ap.error("run needs --quadrig and --blind, the built programs")
    known = {line["log"]: line for line in known}
    with tempfile.TemporaryDirectory() as folder:
        part, parts = map(int, a.part.split("/"))
        for k, (name, log, other, truth) in enumerate(cases(a, Path(folder))):
            if k % parts != part or (name in known) != (a.what == "refresh"):
                continue
            known[name] = work(a.quadrig, name, log, other, truth, known.get(name))
            fresh = lines.with_suffix(".new")
            fresh.write_text("".join(json.dumps(line) + "\n" for line in known.values()))
            fresh.replace(lines)
            seconds = {k: round(v, 1) for k, v in known[name]["seconds"].items()}
            print(name, truth["kind"], known[name]["verdict"], seconds, file=sys.stderr)


if __name__ == "__main__":
    main()
