"""The denoising chain as ONNX graphs, from the description that `ours network` prints."""

import numpy as np
from onnx import TensorProto, checker, helper, numpy_helper

# Two ways to write x tanh(ln(1 + e^x)); which is faster depends on the runtime.
MISH = ("softplus", "rational")
OPSET = 17


class Graph:
    """Nodes and constants, each value by its name."""

    def __init__(self, description, mish):
        self.description, self.mish_form = description, mish
        self.nodes, self.constants = [], []

    def add(self, operation, *inputs, **attributes):
        name = f"v{len(self.nodes)}"
        self.nodes.append(helper.make_node(operation, list(inputs), [name], **attributes))
        return name

    def constant(self, values, shape=None):
        name = f"c{len(self.constants)}"
        array = np.asarray(values, np.float32)
        self.constants.append(numpy_helper.from_array(array if shape is None else array.reshape(shape), name))
        return name

    def row(self, key):
        return self.constant(self.description[key], (1, -1))

    def matrix(self, key):
        return self.constant(self.description[key], (-1, self.description["hidden"]))

    def dense(self, x, layer):
        bias = np.asarray(layer["bias"], np.float32)
        weights = self.constant(layer["weights"], (-1, bias.size))
        return self.add("Gemm", x, weights, self.constant(bias))

    def mish(self, x):
        if self.mish_form == "softplus":
            return self.add("Mul", x, self.add("Tanh", self.add("Softplus", x)))
        # x n / (n + 2) with n = e (e + 2), as ours.
        e = self.add("Exp", x)
        two = self.constant(2.0)
        n = self.add("Mul", e, self.add("Add", e, two))
        return self.add("Mul", x, self.add("Div", n, self.add("Add", n, two)))

    def context(self, state, condition):
        described = self.description
        embedding = condition
        for index, layer in enumerate(described["kappa"]):
            embedding = self.dense(embedding if index == 0 else self.mish(embedding), layer)
        normalised = self.add("Mul", self.add("Sub", state, self.row("state_mean")), self.row("state_factor"))
        of_state = self.dense(normalised, described["context_state"])
        return self.add("Add", of_state, self.add("MatMul", embedding, self.matrix("context_kappa")))

    def eps(self, action, time, context):
        described = self.description
        first = self.add("Add", self.add("Add", time, context),
                         self.add("MatMul", action, self.matrix("action_input")))
        second = self.dense(self.mish(first), described["hidden_2"])
        third = self.dense(self.mish(second), described["hidden_3"])
        return self.dense(self.mish(third), described["output"])

    def model(self, inputs, output, columns):
        value = helper.make_tensor_value_info
        described = [value(name, TensorProto.FLOAT, shape) for name, shape in inputs.items()]
        graph = helper.make_graph(self.nodes, "chain", described, [value(output, TensorProto.FLOAT, [1, columns])],
                                  self.constants)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=9)
        checker.check_model(model)
        return model


def whole(description, mish):
    """State, condition and draws to the action: every step of the chain, one after the other."""
    graph = Graph(description, mish)
    context = graph.context("state", "condition")
    times = np.asarray(description["time_table"], np.float32).reshape(-1, description["hidden"])
    draw = lambda index: graph.add("Gather", "noise", index_of(graph, index))
    low, high = graph.row("action_low"), graph.row("action_high")
    action = draw(0)
    for index, step in enumerate(description["chain"]):
        eps = graph.eps(action, graph.constant(times[step["n"] - 1], (1, -1)), context)
        scaled = lambda x, key: graph.add("Mul", x, graph.constant(step[key]))
        estimate = graph.add("Sub", scaled(action, "from_action"), scaled(eps, "from_noise"))
        x0 = graph.add("Min", graph.add("Max", estimate, low), high)
        action = graph.add("Add", scaled(x0, "to_x0"), scaled(action, "to_action"))
        if step["sigma"]:
            action = graph.add("Add", action, scaled(draw(index + 1), "sigma"))
    return graph.model({"state": [1, len(description["state_mean"])], "condition": [1, 1],
                        "noise": [len(description["chain"]) + 1, len(description["action_low"])]},
                       action, len(description["action_low"]))


def index_of(graph, index):
    name = f"i{index}"
    graph.constants.append(numpy_helper.from_array(np.asarray([index], np.int64), name))
    return name


def context(description, mish):
    """State and condition to what a step needs of them."""
    graph = Graph(description, mish)
    output = graph.context("state", "condition")
    return graph.model({"state": [1, len(description["state_mean"])], "condition": [1, 1]},
                       output, description["hidden"])


def step(description, mish):
    """Action, row of the time table and context to eps."""
    graph = Graph(description, mish)
    hidden = description["hidden"]
    output = graph.eps("action", "time", "context")
    return graph.model({"action": [1, len(description["action_low"])], "time": [1, hidden], "context": [1, hidden]},
                       output, len(description["action_low"]))
