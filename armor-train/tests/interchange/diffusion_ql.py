"""A policy from elsewhere: a Diffusion-QL denoiser in PyTorch, saved as its users save it,
and the actions that it takes. `tests/interchange.rs` imports the one and expects the other.

    python -m venv venv && venv/bin/pip install torch==2.15.0 safetensors==0.8.0
    venv/bin/python diffusion_ql.py     # writes policy.safetensors and expected.json beside itself

The network is that of the publication (Wang, Hunt and Zhou 2023: a time embedding by sines and
cosines, then an MLP with Mish over action, time and state), shortly trained; its chain the publication's: a
variance-preserving schedule, estimates clipped to the actions' bounds. The deterministic chain is
DDIM over evenly spaced levels. The noise is Philox-4x32-10 and Box-Muller at the places that
ARMOR's controller addresses: counter [block, stream, tick, 0], key [seed, 0].
"""

import json
import math
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import save_file
from torch import nn

STATE, ACTION, HIDDEN, CODE, STEPS = 5, 3, 24, 16, 20
BETA_MIN, BETA_MAX = 0.1, 10.0
SEED = 6
# As policy.toml says.
MEAN = torch.tensor([0.5, -1.0, 0.0, 2.0, 0.25])
STD = torch.tensor([2.0, 0.5, 1.0, 4.0, 0.125])
LOW = torch.tensor([-1.0, -0.5, -2.0])
HIGH = torch.tensor([1.0, 0.75, 2.0])


class SinusoidalPosEmb(nn.Module):
    def __init__(self, dim):
        super().__init__()
        self.dim = dim

    def forward(self, t):
        half = self.dim // 2
        frequencies = torch.exp(torch.arange(half) * -(math.log(10000) / (half - 1)))
        angles = t[:, None] * frequencies[None, :]
        return torch.cat((angles.sin(), angles.cos()), dim=-1)


class Denoiser(nn.Module):
    def __init__(self):
        super().__init__()
        self.time_mlp = nn.Sequential(
            SinusoidalPosEmb(CODE), nn.Linear(CODE, 2 * CODE), nn.Mish(), nn.Linear(2 * CODE, CODE)
        )
        self.mid_layer = nn.Sequential(
            nn.Linear(STATE + ACTION + CODE, HIDDEN), nn.Mish(),
            nn.Linear(HIDDEN, HIDDEN), nn.Mish(),
            nn.Linear(HIDDEN, HIDDEN), nn.Mish(),
        )  # fmt: skip
        self.final_layer = nn.Linear(HIDDEN, ACTION)

    def forward(self, action, time, state):
        return self.final_layer(self.mid_layer(torch.cat([action, self.time_mlp(time), state], dim=1)))


def alpha_bar(n):
    t = n / STEPS
    return math.exp(-(BETA_MIN * t + 0.5 * (BETA_MAX - BETA_MIN) * t * t))


def philox(counter, key):
    c, k = list(counter), list(key)
    for _ in range(10):
        p0, p1 = 0xD2511F53 * c[0], 0xCD9E8D57 * c[2]
        c = [(p1 >> 32) ^ c[1] ^ k[0], p1 & 0xFFFFFFFF, (p0 >> 32) ^ c[3] ^ k[1], p0 & 0xFFFFFFFF]
        k = [(k[0] + 0x9E3779B9) & 0xFFFFFFFF, (k[1] + 0xBB67AE85) & 0xFFFFFFFF]
    return c


def normals(stream, tick, count):
    draws = []
    for block in range((count + 3) // 4):
        words = philox([block, stream, tick, 0], [SEED, 0])
        for a, b in (words[:2], words[2:]):
            radius = math.sqrt(-2 * math.log(1 - (a >> 8) / 2**24))
            angle = 2 * math.pi * (b >> 8) / 2**24
            draws += [radius * math.cos(angle), radius * math.sin(angle)]
    return torch.tensor(draws[:count])


def act(model, state, tick, levels, deterministic):
    """One action; `levels` fall from N to 0."""
    action = normals(0, tick, ACTION)
    for step, (n, m) in enumerate(zip(levels, levels[1:])):
        here, there = alpha_bar(n), alpha_bar(m)
        eps = model(action[None], torch.tensor([n - 1.0]), state[None])[0]
        x0 = ((action - math.sqrt(1 - here) * eps) / math.sqrt(here)).clamp(LOW, HIGH)
        if deterministic:
            direction = (action - math.sqrt(here) * x0) / math.sqrt(1 - here)
            action = math.sqrt(there) * x0 + math.sqrt(1 - there) * direction
        else:
            alpha = here / there
            mean = math.sqrt(there) * (1 - alpha) / (1 - here) * x0
            mean = mean + math.sqrt(alpha) * (1 - there) / (1 - here) * action
            std = math.sqrt((1 - alpha) * (1 - there) / (1 - here))
            action = mean + std * normals(step + 1, tick, ACTION) if m > 0 else mean
    return action


def clone(model):
    """A short training, so that actions lie within the bounds: a = 0.6 tanh of three sums of the state."""
    optimiser = torch.optim.Adam(model.parameters(), lr=3e-3)
    bars = torch.tensor([alpha_bar(n) for n in range(STEPS + 1)])
    for _ in range(600):
        state = torch.randn(256, STATE)
        action = 0.6 * torch.tanh(state[:, :3] - 0.5 * state[:, 2:])
        n, eps = torch.randint(1, STEPS + 1, (256,)), torch.randn(256, ACTION)
        noisy = bars[n].sqrt()[:, None] * action + (1 - bars[n]).sqrt()[:, None] * eps
        optimiser.zero_grad()
        (model(noisy, n - 1.0, state) - eps).square().mean().backward()
        optimiser.step()


def main():
    torch.manual_seed(1)
    torch.set_num_threads(1)
    model = Denoiser()
    clone(model)
    here = Path(__file__).parent
    # Diffusion-QL saves the state of its `Diffusion`, whose network is `model`.
    save_file({f"model.{name}": tensor for name, tensor in model.state_dict().items()}, here / "policy.safetensors")

    model = model.double()
    torch.set_default_dtype(torch.float64)
    states = (MEAN + STD * torch.randn(4, STATE)).float()
    ladder = {"ddpm_20": list(range(20, -1, -1)), "ddim_5": [20, 16, 12, 8, 4, 0]}
    expected = {"seed": SEED, "states": states.tolist()}
    with torch.no_grad():
        seen = (states.double() - MEAN) / STD
        for name, levels in ladder.items():
            rows = [act(model, state, tick, levels, name == "ddim_5") for tick, state in enumerate(seen)]
            expected[name] = torch.stack(rows).tolist()
    inside = np.mean([low < x < high for row in expected["ddim_5"] for x, low, high in zip(row, LOW, HIGH)])
    assert inside > 0.3, "most actions lie on a bound, and would agree by accident"
    (here / "expected.json").write_text(json.dumps(expected, indent=1) + "\n")


if __name__ == "__main__":
    main()
