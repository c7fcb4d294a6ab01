"""The sides of latency.py that run in Python: onnxruntime, tract and PyTorch.

usage: latency_python.py onnxruntime MODEL NETWORK | onnxruntime-steps FOLDER NETWORK
                         | tract MODEL NETWORK | torch-eager NETWORK | torch-jit NETWORK | torch-compile NETWORK
"""

import json
import pathlib
import sys
import time

import numpy as np


def serve(act):
    """Answers each number of actions with their durations in us and the last action."""
    for line in sys.stdin:
        durations = []
        for _ in range(int(line)):
            started = time.perf_counter_ns()
            action = act()
            durations.append((time.perf_counter_ns() - started) / 1000)
        print(json.dumps({"us": durations, "action": [float(entry) for entry in action.reshape(-1)]}), flush=True)


def inputs(description):
    problem = description["problem"]
    floats = lambda values, shape: np.asarray(values, np.float32).reshape(shape)
    return {"state": floats(problem["state"], (1, -1)), "condition": floats(problem["condition"], (1, 1)),
            "noise": floats(problem["noise"], (len(problem["noise"]), -1))}


def session(model):
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_ALL
    return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])


def onnxruntime_whole(model, description):
    run, given = session(model), inputs(description)
    return lambda: run.run(None, given)[0]


def onnxruntime_steps(folder, description):
    """The context once, then a call of the denoiser a step; what is between is numpy's."""
    context, step = (session(pathlib.Path(folder) / f"{part}-rational.onnx") for part in ("context", "step"))
    given = inputs(description)
    noise = given.pop("noise")
    times = np.asarray(description["time_table"], np.float32).reshape(-1, description["hidden"])
    low, high = (np.asarray(description[key], np.float32) for key in ("action_low", "action_high"))
    single = lambda step: {key: np.float32(value) for key, value in step.items() if key != "n"} | {
        "time": times[step["n"] - 1:step["n"]]}
    chain = [single(step) for step in description["chain"]]

    def act():
        of_state = context.run(None, given)[0]
        action = noise[:1]
        for index, now in enumerate(chain):
            eps = step.run(None, {"action": action, "time": now["time"], "context": of_state})[0]
            x0 = np.minimum(np.maximum(now["from_action"] * action - now["from_noise"] * eps, low), high)
            action = now["to_x0"] * x0 + now["to_action"] * action
            if now["sigma"]:
                action = action + now["sigma"] * noise[index + 1:index + 2]
        return action

    return act


def tract_whole(model, description):
    import tract

    run = tract.onnx().load(str(model)).into_model().into_runnable()
    given = [tract.Tensor.from_numpy(value) for value in inputs(description).values()]
    return lambda: run.run(given)[0].to_numpy()


def torch_side(form, description):
    import torch
    from torch import nn

    torch.set_num_threads(1)
    torch.set_grad_enabled(False)
    hidden = description["hidden"]
    tensor = lambda values: torch.tensor(values, dtype=torch.float32)

    def linear(layer):
        bias = tensor(layer["bias"])
        made = nn.Linear(1, 1)
        made.weight = nn.Parameter(tensor(layer["weights"]).reshape(-1, bias.numel()).T.contiguous())
        made.bias = nn.Parameter(bias)
        return made

    class Chain(nn.Module):
        def __init__(self):
            super().__init__()
            self.kappa = nn.ModuleList(linear(layer) for layer in description["kappa"])
            self.context_state = linear(description["context_state"])
            self.layers = nn.ModuleList(linear(description[key]) for key in ("hidden_2", "hidden_3", "output"))
            for key in ("context_kappa", "action_input", "time_table"):
                self.register_buffer(key, tensor(description[key]).reshape(-1, hidden))
            for key in ("state_mean", "state_factor", "action_low", "action_high"):
                self.register_buffer(key, tensor(description[key]))

        def forward(self, state, condition, noise):
            mish = nn.functional.mish
            embedding = self.kappa[2](mish(self.kappa[1](mish(self.kappa[0](condition)))))
            context = self.context_state((state - self.state_mean) * self.state_factor)
            context = context + embedding @ self.context_kappa
            action = noise[0:1]
            for index, step in enumerate(description["chain"]):
                x = self.time_table[step["n"] - 1] + context + action @ self.action_input
                for layer in self.layers:
                    x = layer(mish(x))
                x0 = step["from_action"] * action - step["from_noise"] * x
                x0 = torch.minimum(torch.maximum(x0, self.action_low), self.action_high)
                action = step["to_x0"] * x0 + step["to_action"] * action
                if step["sigma"]:
                    action = action + step["sigma"] * noise[index + 1:index + 2]
            return action

    chain = Chain().eval()
    given = [torch.from_numpy(value) for value in inputs(description).values()]
    if form == "jit":
        chain = torch.jit.freeze(torch.jit.trace(chain, given))
    elif form == "compile":
        chain = torch.compile(chain, mode="max-autotune")

    def act():
        with torch.inference_mode():
            return chain(*given).numpy()

    return act


def main():
    side, *arguments = sys.argv[1:]
    description = json.loads(pathlib.Path(arguments[-1]).read_text())
    if side == "onnxruntime":
        serve(onnxruntime_whole(arguments[0], description))
    elif side == "onnxruntime-steps":
        serve(onnxruntime_steps(arguments[0], description))
    elif side == "tract":
        serve(tract_whole(arguments[0], description))
    else:
        serve(torch_side(side.removeprefix("torch-"), description))


if __name__ == "__main__":
    main()
