"""Times an action of the 20-step chain, ours and in other runtimes; run by latency.sh.

Every side is a process that does N actions on request and answers with what
each of them took, by its own clock. The sides take turns, round by round, so
that a busy moment of the machine falls on all of them; the table has the median
over all actions, and its ratio to the fastest of the others. All run on one
thread, on the same network, state, budget and noise, and the action of each must
be ours: within 1e-4 for the peers, and printed for the integers. That means
something only where the last clip does not hide a difference, so the action must
lie within its bounds, and the chain with one coefficient 1 % off must miss ours.

The peers have what ours has: the state's and the budget's part of layer 1 is
computed once an action, and the time embedding is a table. They are given the
noise; ours draws it. Where a runtime has several good forms, all are timed.

usage: latency.py PROGRAMS IMAGES [--rounds 30] [--actions 30]
"""

import argparse
import copy
import json
import os
import pathlib
import statistics
import subprocess
import sys

import onnx

import latency_python
import onnx_chain

HERE = pathlib.Path(__file__).parent
AGREEMENT = 1e-4
# Coefficients of a step that are put 1 % off, one at a time.
COEFFICIENTS = ("from_action", "from_noise", "to_x0", "to_action", "sigma")
ONE_THREAD = {key: "1" for key in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS", "OPENBLAS_NUM_THREADS")}


class Side:
    """A process that answers a number of actions with their durations."""

    def __init__(self, name, command):
        self.name, self.durations, self.action = name, [], None
        self.process = subprocess.Popen([str(word) for word in command], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        text=True, env=os.environ | ONE_THREAD)

    def ask(self, actions):
        self.process.stdin.write(f"{actions}\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        if not line:
            sys.exit(f"{self.name} ended; its own message is above")
        answer = json.loads(line)
        self.action = answer["action"]
        return answer["us"]

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def distance(action, other):
    return max(abs(a - b) for a, b in zip(action, other, strict=True))


def check_the_check(images, description, action):
    """Ends the program where an error in the chain would pass for agreement."""
    for entry, low, high in zip(action, description["action_low"], description["action_high"], strict=True):
        if not low < entry < high:
            sys.exit(f"our action {action} is clipped at the end, which hides differences; train the policies longer")
    answer = lambda described: latency_python.onnxruntime_steps(images, described)().reshape(-1).tolist()
    if not distance(answer(description), action) <= AGREEMENT:
        sys.exit("onnxruntime does not compute the same, a call a step")
    # The last two steps: the last has no noise, and its action is the estimate alone.
    for coefficient in COEFFICIENTS:
        step = -1 if coefficient in ("from_action", "from_noise", "to_x0") else -2
        wrong = copy.deepcopy(description)
        wrong["chain"][step][coefficient] *= 1.01
        off = distance(answer(wrong), action)
        print(f"with {coefficient} of step {len(wrong['chain']) + step + 1} 1 % off: {off:.1e} off ours", file=sys.stderr)
        if off <= AGREEMENT:
            sys.exit(f"a wrong {coefficient} would pass for agreement")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", type=pathlib.Path)
    parser.add_argument("images", type=pathlib.Path)
    parser.add_argument("--rounds", type=int, default=30)
    parser.add_argument("--actions", type=int, default=30)
    arguments = parser.parse_args()
    programs, images = arguments.programs, arguments.images

    described = subprocess.run([programs / "ours", "network", images / "f32.armor"], check=True, capture_output=True)
    network = images / "network.json"
    network.write_bytes(described.stdout)
    description = json.loads(described.stdout)
    for mish in onnx_chain.MISH:
        onnx.save(onnx_chain.whole(description, mish), images / f"chain-{mish}.onnx")
    onnx.save(onnx_chain.step(description, "rational"), images / "step-rational.onnx")
    onnx.save(onnx_chain.context(description, "rational"), images / "context-rational.onnx")

    python = [sys.executable, HERE / "latency_python.py"]
    ours = [Side(f"ours {name}", [programs / "ours", "fly", images / f"{name}.armor"])
            for name in ("f32", "int16x8", "int8")]
    read = Side("reading the weights", [programs / "ours", "read", images / "f32.armor"])
    peers = [Side(f"onnxruntime, one graph, {mish}", [*python, "onnxruntime", images / f"chain-{mish}.onnx", network])
             for mish in onnx_chain.MISH]
    peers += [Side("onnxruntime, a call a step", [*python, "onnxruntime-steps", images, network])]
    peers += [Side(f"tract, one graph, {mish}", [*python, "tract", images / f"chain-{mish}.onnx", network])
              for mish in onnx_chain.MISH]
    peers += [Side("candle", [programs / "candle", network])]
    peers += [Side(f"PyTorch, {form}", [*python, f"torch-{form}", network]) for form in ("eager", "jit", "compile")]

    sides = [*ours, read, *peers]
    for side in sides:
        side.ask(arguments.actions)  # Untimed: caches, clocks, compilers.
    for _ in range(arguments.rounds):
        for side in sides:
            side.durations += side.ask(arguments.actions)
    for side in sides:
        side.close()

    float_action = ours[0].action
    check_the_check(images, description, float_action)
    off = {side.name: distance(side.action, float_action) for side in [*ours, *peers]}
    for side in peers:
        if not off[side.name] <= AGREEMENT:
            sys.exit(f"{side.name} answers {side.action}, not {float_action}: it does not compute the same")

    median = {side.name: statistics.median(side.durations) for side in sides}
    best = min(median[side.name] for side in peers)
    print(f"| {'side':<32} | {'us, median':>10} | {'us, p10':>8} | {'best peer by it':>15} | {'off ours':>8} |")
    print("|---|---|---|---|---|")
    for side in sides:
        tenth = statistics.quantiles(side.durations, n=10)[0]
        difference = f"{off[side.name]:.1e}" if side.name in off else ""
        print(f"| {side.name:<32} | {median[side.name]:>10.1f} | {tenth:>8.1f} | {best / median[side.name]:>15.2f} "
              f"| {difference:>8} |")
    print(f"\nours f32 is at {median[read.name] / median['ours f32']:.0%} of the speed at which its weights can be read;"
          f" load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors, {arguments.rounds} rounds of"
          f" {arguments.actions} actions")


if __name__ == "__main__":
    main()
