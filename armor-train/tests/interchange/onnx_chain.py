"""Runs a policy's denoising step in onnxruntime, against the controller.

    onnx_chain.py POLICY.onnx TRACE.json    (what `firmware-sim trace --json` printed)

At every step of the traced chain the graph is given the traced noisy action, and its answer is
compared with the traced one, which is in f64. Then the whole chain is run on the graph's own
answers, and what it ends in is compared with the controller's action, which is in f32.
"""

import json
import sys

import numpy as np
import onnxruntime

BOUND = 1e-5


def main(graph, trace):
    session = onnxruntime.InferenceSession(graph, providers=["CPUExecutionProvider"])
    trace = json.load(open(trace))
    state, kappa = np.float32([trace["state"]]), np.float32([[trace["kappa"]]])

    def eps(action, level):
        inputs = {"action": np.float32([action]), "state": state, "kappa": kappa, "level": np.int64([level])}
        return session.run(["eps"], inputs)[0][0]

    worst, action = 0.0, np.array(trace["start"])
    before = action
    for step in trace["steps"]:
        worst = max(worst, np.abs(eps(before, step["n"]) - step["eps"]).max())
        before = np.array(step["action"])

    # Each step is x0 = clip(p a - q eps), a = u x0 + v a + w z; the trace has all but the numbers
    # p to w, which follow from the schedule that the paper gives (Eqs. 11 and 12).
    bar = lambda n: np.exp(-(0.1 * n / levels + 0.5 * 9.9 * (n / levels) ** 2))
    levels = trace["steps"][0]["n"]
    for step, m in zip(trace["steps"], [step["n"] for step in trace["steps"][1:]] + [0]):
        n = step["n"]
        here, there, alpha = bar(n), bar(m), bar(n) / bar(m)
        x0 = np.clip((action - np.sqrt(1 - here) * eps(action, n)) / np.sqrt(here), -1, 1)
        mean = np.sqrt(there) * (1 - alpha) / (1 - here) * x0 + np.sqrt(alpha) * (1 - there) / (1 - here) * action
        action = mean + np.sqrt((1 - alpha) * (1 - there) / (1 - here)) * np.array(step["noise"])
    end = np.abs(action - trace["controller_action"]).max()

    # A batch is its samples, one by one.
    batch = {
        "action": np.float32([trace["start"], trace["action"]]),
        "state": np.repeat(state, 2, axis=0),
        "kappa": np.repeat(kappa, 2, axis=0),
        "level": np.int64([levels, 1]),
    }
    both = session.run(["eps"], batch)[0]
    alone = [eps(trace["start"], levels), eps(trace["action"], 1)]
    apart = np.abs(both - alone).max()
    print(f"interchange: {len(trace['steps'])} steps in onnxruntime: eps off by {worst:.1e}, action by {end:.1e}")
    return int(not (worst < BOUND and end < BOUND and apart < BOUND))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
