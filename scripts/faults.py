#!/usr/bin/env python3
"""Faults around a run, each tried many times, and what was lost: a Markdown table.

    scripts/faults.py [--program target/release/scatterproof] [--only TEXT] [--seed N]

Every trial ends with the same command run to its end, and the record that it leaves must have the bytes of an undisturbed
run. Some rows need strace or root (a full disk) and are left out without. Python 3.8 or later, standard library only;
about five minutes.
"""
import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

EXPERIMENT = """name = "x"
seed = 3
bands = { rgb = {} }
object.shape.sphere = { radius_mm = 1.0 }
object.boundary.rough = { distribution = "ggx", alpha = 0.3, eta = 1.3 }
object.medium.coefficients = { sigma_t_per_mm = [1, 2, 4], albedo = 0.9, g = 0.0 }
sensor.orthographic = { resolution = [24, 24], center_mm = [0, 0, 5], toward = [0, 0, -1], up = [0, 1, 0], width_mm = 2.2 }
light = [{ name = "sky", environment = { radiance = 1.0 } }]
estimator = [{ name = "mis", path = {} }, { name = "analog", path = { roulette = { analog = {} } } }]
sweep = [{ key = "object.medium.coefficients.g", values = [0.0, 0.4] }]
budget.passes = 60
claim = [{ name = "agree", agree = { estimators = ["mis", "analog"], detect = 0.2 } }]
"""


class Bench:
    """A folder with the experiment, and the record of an undisturbed run."""

    def __init__(self, program, folder):
        self.program, self.folder = program, Path(folder)
        (self.folder / "x.toml").write_text(EXPERIMENT)
        self.run("whole")
        self.whole = self.record("whole")

    def command(self, out, passes=60, command="run"):
        return [self.program, command, "x.toml", "--quiet", "--threads", "1", "--out", str(out), "--set",
                f"budget.passes={passes}"]

    def run(self, out, passes=60, expected=(0,), command="run"):
        ran = subprocess.run(self.command(out, passes, command), cwd=self.folder, capture_output=True, text=True)
        if ran.returncode not in expected:
            raise SystemExit(f"exit code {ran.returncode}: {ran.args}\n{ran.stderr}")
        return ran

    def start(self, out, passes=60, before=()):
        return subprocess.Popen([*before, *self.command(out, passes)], cwd=self.folder, stdout=subprocess.DEVNULL,
                                stderr=subprocess.PIPE, text=True)

    def record(self, out):
        root = self.folder / out / "x" / "record"
        return {str(path.relative_to(root)): path.read_bytes() for path in sorted(root.rglob("*")) if path.is_file()}

    def fresh(self, copy_of=None):
        shutil.rmtree(self.folder / "out", ignore_errors=True)
        if copy_of:
            shutil.copytree(self.folder / copy_of, self.folder / "out")
        return "out"

    def heals(self, out):
        """The same command to its end gives the bytes of the undisturbed run, and nothing unfinished stays."""
        self.run(out)
        left = [str(p) for p in (self.folder / out).rglob(".*") if p.name != ".lock"]
        same = self.record(out) == self.whole
        if left or not same:
            print("unfinished:" if same else "ANOTHER RECORD", *left, file=sys.stderr)
        return same and not left


class Table:
    def __init__(self, only):
        self.only, self.rows, self.lost = only, [], 0

    def row(self, what, trials):
        """`trials` yields True where nothing was lost."""
        if self.only and self.only not in what:
            return
        begun, count, lost = time.time(), 0, 0
        for kept in trials():
            count, lost = count + 1, lost + (not kept)
        if count:
            self.rows.append((what, count, lost))
            self.lost += lost
        print(f"{what}: {count} tried, {lost} lost, {time.time() - begun:.0f} s" if count else f"{what}: left out",
              file=sys.stderr)

    def text(self):
        lines = ["| what was done | how often | lost |", "| --- | ---: | ---: |"]
        return "\n".join(lines + [f"| {what} | {count} | {lost} |" for what, count, lost in self.rows])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", default="target/release/scatterproof")
    parser.add_argument("--only", help="rows whose words contain TEXT", metavar="TEXT")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    chance = random.Random(args.seed)
    table = Table(args.only)
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(os.path.abspath(args.program), folder)
        begun = time.time()
        bench.run(bench.fresh())
        length = time.time() - begun

        def killed():
            for _ in range(20):
                out = bench.fresh()
                for _ in range(chance.randint(1, 3)):
                    program = bench.start(out)
                    time.sleep(chance.uniform(0, 1.1 * length))
                    program.kill()
                    program.communicate()
                yield bench.heals(out)

        def signalled():
            for name in ["SIGHUP", "SIGINT", "SIGTERM", "SIGXCPU"]:
                for _ in range(5):
                    out = bench.fresh()
                    program = bench.start(out)
                    time.sleep(chance.uniform(0.02, length))
                    program.send_signal(getattr(signal, name))
                    sent = time.time()
                    program.communicate()
                    # One that is not listening yet ends by the signal itself.
                    good = program.returncode in (0, 130, -getattr(signal, name)) and time.time() - sent < 2
                    yield good and bench.heals(out)

        def renamed(how):
            def trials():
                if not shutil.which("strace"):
                    return
                bench.run("earlier", passes=20)
                earlier = bench.record("earlier")
                for when in range(1, 100):
                    out = bench.fresh("earlier")
                    inject = f"inject=rename:{how}:when={when}"
                    before = ["strace", "-f", "-qq", "-o", "/dev/null", "-e", "trace=rename", "-e", inject]
                    program = bench.start(out, before=before)
                    program.communicate()
                    there = bench.record(out) in (earlier, bench.whole)
                    aside = (bench.folder / out / "x" / ".record.old").is_dir()
                    yield (there or aside) and bench.heals(out)
                    if program.returncode == 0:
                        return
            return trials

        def doubled():
            for _ in range(20):
                out = bench.fresh("whole")
                shutil.rmtree(bench.folder / out / "x" / "record")
                both = [bench.start(out), bench.start(out)]
                said = [program.communicate()[1] for program in both]
                good = all(program.returncode == 0 or program.returncode == 3 and "another process" in words
                           for program, words in zip(both, said))
                yield good and bench.record(out) == bench.whole and bench.heals(out)

        def damaged(part):
            def trials():
                root = bench.folder / "whole" / "x"
                files = [p for p in sorted(root.rglob("*")) if p.is_file() and p.name != ".lock"]
                files = [p.relative_to(root) for p in files if str(p.relative_to(root)).startswith(part)]
                for name in files:
                    for how in ["cut", "flip", "empty", "remove"]:
                        out = bench.fresh("whole")
                        path = bench.folder / out / "x" / name
                        data = bytearray(path.read_bytes())
                        if how == "remove":
                            path.unlink()
                        else:
                            at = chance.randrange(max(1, len(data)))
                            if how == "flip":
                                data[at] ^= 1 << chance.randrange(8)
                            path.write_bytes(data if how == "flip" else data[:at] if how == "cut" else b"")
                        yield bench.heals(out)
            return trials

        def full():
            if os.geteuid() != 0 or not shutil.which("mount"):
                return
            point = bench.folder / "disk"
            point.mkdir(exist_ok=True)
            for kib in [64, 128, 256, 384, 512, 1024, 2048, 4096]:
                if subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={kib}k", "none", str(point)]).returncode:
                    return
                try:
                    # 0 where it suffices.
                    ran = bench.run("disk", expected=(0, 3))
                    named = ran.returncode == 0 or "No space left" in ran.stderr
                    subprocess.run(["mount", "-o", "remount,size=100m", str(point)], check=True)
                    yield named and bench.heals("disk")
                finally:
                    subprocess.run(["umount", str(point)], check=True)

        def shard_killed():
            for index in range(1, 11):
                out = bench.fresh()
                number = f"{chance.randint(1, 3)}/3"
                program = subprocess.Popen([*bench.command(out), "--shard", number], cwd=bench.folder,
                                           stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                time.sleep(chance.uniform(0, length / 3))
                program.kill()
                program.wait()
                for i in chance.sample([1, 2, 3], 3):
                    subprocess.run([*bench.command(out), "--shard", f"{i}/3"], cwd=bench.folder, check=True,
                                   stdout=subprocess.DEVNULL)
                subprocess.run([bench.program, "merge", "x.toml", "--out", out], cwd=bench.folder, check=True,
                               stdout=subprocess.DEVNULL)
                yield bench.record(out) == bench.whole and bench.heals(out)

        table.row("SIGKILL at random moments, one to three times", killed)
        table.row("SIGKILL at a rename, over an earlier record", renamed("signal=SIGKILL"))
        table.row("a rename that fails (EIO), over an earlier record", renamed("error=EIO"))
        table.row("SIGHUP, SIGINT, SIGTERM, SIGXCPU at random moments: ended within 2 s", signalled)
        table.row("two processes on one folder", doubled)
        table.row("a disk that is full, then enlarged", full)
        table.row("a file of the record cut, flipped, emptied, removed", damaged("record"))
        table.row("a state cut, flipped, emptied, removed", damaged("state"))
        table.row("timing cut, flipped, emptied, removed", damaged("timing"))
        table.row("a shard killed and run again, shards in random order", shard_killed)
    print(table.text())
    return 1 if table.lost else 0


sys.exit(main())
