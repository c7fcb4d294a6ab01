"""Times one full training step of ours and of PyTorch's, side by side; run by train_step.sh.

Both sides are processes that do N steps on request. They take turns, round by
round, so that a busy or a slow machine slows both; while one works the other
sleeps. CPU time is what the kernel charged to all threads of the side that
works; the table gives medians over the rounds.

Our backward pass along the chain leaves out samples whose estimate x0 is
clipped in every entry, so its time depends on the networks, and fresh ones
flatter it: a step takes a fifth longer once 130 are done, and no longer after. Ours
therefore trains some steps before it is timed (on random
numbers: real data clip more or less). PyTorch's time does not depend on them.

usage: train_step.py OUR_PROGRAM [--rounds 7] [--steps 3] [--warmup 200] [--threads 1 2]
"""

import argparse
import os
import pathlib
import statistics
import subprocess
import sys
import time

import torch_step as sizes

HERE = pathlib.Path(__file__).parent


class Side:
    """A process that answers a line with a line when the work is done."""

    def __init__(self, command, threads):
        # A thread of OpenMP that waits does not spin: that would count as work.
        environment = {"RAYON_NUM_THREADS": threads, "OMP_NUM_THREADS": threads, "OMP_WAIT_POLICY": "PASSIVE"}
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                                        env=os.environ | {key: str(value) for key, value in environment.items()})

    def cpu_seconds(self):
        tasks = pathlib.Path(f"/proc/{self.process.pid}/task").glob("*/schedstat")
        return sum(int(task.read_text().split()[0]) for task in tasks) / 1e9

    def ask(self, request):
        """CPU and wall time of a request in seconds, and its answer."""
        cpu, wall = self.cpu_seconds(), time.perf_counter()
        self.process.stdin.write(request + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            sys.exit(f"{self.process.args} ended; its own message is above")
        return self.cpu_seconds() - cpu, time.perf_counter() - wall, answer.strip()

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def multiply_adds():
    """Multiplications and additions of our step's matrix products: 2 m k n each.

    One pass is a forward pass; a backward pass to weights or to inputs costs the
    same. What is constant along a chain is counted once, as we compute it; the
    embeddings, the dual network and all element-wise work are left out. Samples
    that the backward pass leaves out are counted as if they took part.
    """
    s = sizes
    layer = lambda inputs, outputs: 2 * inputs * outputs
    # Denoiser: action block, two hidden layers, output; and the constant part of the first layer.
    call = layer(s.ACTION, s.HIDDEN) + 2 * layer(s.HIDDEN, s.HIDDEN) + layer(s.HIDDEN, s.ACTION)
    constant = layer(s.STATE + s.KAPPA_EMBEDDING, s.HIDDEN)
    target_chain = s.LEVELS * call + constant
    cloning_and_policy_chain = (1 + s.LEVELS) * 3 * call + 2 * constant
    first, second = layer(s.STATE + 1 + s.ACTION, s.TRUNK), layer(s.TRUNK, s.TRUNK)
    head = layer(s.TRUNK, s.HEAD) + layer(s.HEAD, 1)
    # Targets, losses; then weights and inputs of the heads, and of the trunk once a task.
    critic = 2 * (first + second + 6 * head) + 2 * 6 * head + 3 * (first + 2 * second)
    # The actor asks two tasks, forward and back to the action.
    judging = 2 * (first + second + 4 * head)
    return s.BATCH * (target_chain + cloning_and_policy_chain + critic + judging)


def measure(program, threads, rounds, steps, warmup):
    ours = Side([program], threads)
    torch = Side([sys.executable, str(HERE / "torch_step.py")], threads)
    products, peak = 20, []
    ours.ask(f"steps {warmup}")
    _, _, version = torch.ask("steps 1")
    times = {"ours": [], "PyTorch": []}
    for _ in range(rounds):
        times["ours"].append(ours.ask(f"steps {steps}")[:2])
        times["PyTorch"].append(torch.ask(f"steps {steps}")[:2])
        peak.append(products * 2 * 1024**3 / ours.ask(f"products {products}")[0] / 1e9)
    for side in (ours, torch):
        side.close()
    median = {name: [1e3 * statistics.median(column) / steps for column in zip(*rows)] for name, rows in times.items()}
    ratio = [theirs / our for theirs, our in zip(median["PyTorch"], median["ours"])]
    speed = multiply_adds() / median["ours"][0] / 1e6
    peak = statistics.median(peak)
    print(f"| {threads} | {median['ours'][0]:.0f} | {median['PyTorch'][0]:.0f} | **{ratio[0]:.2f}** "
          f"| {median['ours'][1]:.0f} | {median['PyTorch'][1]:.0f} | **{ratio[1]:.2f}** "
          f"| {speed:.0f} | {peak:.0f} |", flush=True)
    return version


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--steps", type=int, default=3)
    parser.add_argument("--warmup", type=int, default=200)
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    arguments = parser.parse_args()
    print(f"One step: batch {sizes.BATCH}, state {sizes.STATE}, action {sizes.ACTION}, hidden {sizes.HIDDEN}, "
          f"{sizes.LEVELS}-step chain with gradient; {multiply_adds() / 1e9:.1f} GFLOP of products.\n")
    print("| threads | CPU ms, ours | CPU ms, PyTorch | ratio | wall ms, ours | wall ms, PyTorch | ratio "
          "| GFLOP per s of CPU time, ours | product peak on one thread |")
    print("|---|---|---|---|---|---|---|---|---|")
    for threads in arguments.threads:
        version = measure(arguments.program, threads, arguments.rounds, arguments.steps, arguments.warmup)
    load = os.getloadavg()[0]
    print(f"\nPyTorch {version}, f32; medians of {arguments.rounds} rounds of {arguments.steps} steps after {arguments.warmup}; "
          f"load average at the end {load:.1f}.")


if __name__ == "__main__":
    main()
