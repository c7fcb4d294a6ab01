"""The same training step in PyTorch, f32: PyTorch's side of train_step.sh.

Plain PyTorch, but no waste: the embeddings of kappa and of the noise levels
are computed once per chain, the targets' chain records no graph, frozen
networks ask for no gradients, the critic's three trunk gradients share one
forward pass and one backward pass through their heads, Adam and the soft
update are the multi-tensor ones.

Reads requests from standard input, as armor-train/examples/bench_step.rs does;
OMP_NUM_THREADS sets the number of threads.
"""

import copy
import itertools
import math
import os
import sys

import torch
from torch import nn
from torch.nn.functional import mse_loss

BATCH, STATE, ACTION = 512, 60, 2
LEVELS, HIDDEN = 20, 256
KAPPA_HIDDEN, KAPPA_EMBEDDING, TIME_CODE, TIME_HIDDEN, TIME_EMBEDDING = 32, 16, 16, 32, 16
TRUNK, HEAD, DUAL = 256, 128, 256
DISCOUNTS = (0.99, 0.99, 0.3)
ETA, TARGET_RATE = 1.0, 0.005
ROWS = 20_000


def mlp(*widths, activation=nn.Mish, activate_output=False):
    layers = []
    for inputs, outputs in zip(widths, widths[1:]):
        layers += [nn.Linear(inputs, outputs), activation()]
    return nn.Sequential(*(layers if activate_output else layers[:-1]))


def sinusoidal_code():
    frequencies = torch.exp(-torch.arange(TIME_CODE // 2) * math.log(10_000) / (TIME_CODE // 2 - 1))
    angles = torch.arange(LEVELS)[:, None] * frequencies
    return torch.cat([angles.sin(), angles.cos()], 1)


class Denoiser(nn.Module):
    def __init__(self):
        super().__init__()
        self.kappa = mlp(1, KAPPA_HIDDEN, KAPPA_HIDDEN, KAPPA_EMBEDDING)
        self.time = mlp(TIME_CODE, TIME_HIDDEN, TIME_EMBEDDING)
        inputs = ACTION + STATE + KAPPA_EMBEDDING + TIME_EMBEDDING
        self.body = mlp(inputs, HIDDEN, HIDDEN, HIDDEN, ACTION)
        self.code = sinusoidal_code()

    def context(self, state, kappa):
        """What stays the same along a chain: state with embedded kappa, embedded levels."""
        return torch.cat([state, self.kappa(kappa)], 1), self.time(self.code)

    def forward(self, action, context, levels):
        fixed, time = context
        # One level for the whole batch, or one for each sample.
        time = time[levels - 1].expand(len(action), -1) if isinstance(levels, int) else time[levels - 1]
        return self.body(torch.cat([action, fixed, time], 1))


class Critic(nn.Module):
    def __init__(self):
        super().__init__()
        self.trunk = mlp(STATE + 1 + ACTION, TRUNK, TRUNK, activate_output=True)
        self.heads = nn.ModuleList(nn.ModuleList(mlp(TRUNK, HEAD, 1) for _ in range(2)) for _ in range(3))

    def pessimistic(self, h, task):
        one, two = (head(h) for head in self.heads[task])
        return torch.minimum(one, two) if task == 0 else torch.maximum(one, two)


class Learner:
    def __init__(self):
        n = torch.arange(1, LEVELS + 1, dtype=torch.float64)
        beta = 1 - torch.exp(-0.1 / LEVELS - 0.5 * 9.9 * (2 * n - 1) / LEVELS**2)
        self.beta = [0.0, *beta.tolist()]
        self.alpha_bar = [1.0, *(1 - beta).cumprod(0).tolist()]
        self.alpha_bars = torch.tensor(self.alpha_bar)
        self.actor, self.critic, self.dual = Denoiser(), Critic(), mlp(1, DUAL, DUAL, 1, activation=nn.ReLU)
        self.target = copy.deepcopy(self.critic).requires_grad_(False)
        adam = lambda network, rate: torch.optim.Adam(network.parameters(), rate, foreach=True)
        self.actor_adam, self.critic_adam = adam(self.actor, 1e-4), adam(self.critic, 1e-3)
        self.dual_adam = adam(self.dual, 1e-4)
        self.trunk = list(self.critic.trunk.parameters())
        self.head_parameters = list(self.critic.heads.parameters())
        self.data = [torch.randn(ROWS, STATE), torch.rand(ROWS, 1), torch.rand(ROWS, ACTION) * 2 - 1,
                     torch.randn(ROWS, 1), (torch.rand(ROWS, 1) < 0.1).float(),
                     torch.randn(ROWS, STATE), torch.rand(ROWS, 1),
                     torch.ones(ROWS, 1), torch.ones(ROWS, 1)]

    def chain(self, state, kappa):
        """DDPM in x0 form (Eq. 12)."""
        context = self.actor.context(state, kappa)
        action = torch.randn(len(state), ACTION)
        for n in range(LEVELS, 0, -1):
            now, before, beta = self.alpha_bar[n], self.alpha_bar[n - 1], self.beta[n]
            noise = self.actor(action, context, n)
            x0 = ((action - math.sqrt(1 - now) * noise) / math.sqrt(now)).clamp(-1, 1)
            action = (math.sqrt(before) * beta / (1 - now)) * x0 \
                + (math.sqrt(1 - beta) * (1 - before) / (1 - now)) * action
            if n > 1:
                action = action + math.sqrt(beta * (1 - before) / (1 - now)) * torch.randn_like(action)
        return action

    def update_critic(self, state, kappa, action, reward, cost, next_state, next_kappa, alive):
        """Eqs. 3 to 5."""
        with torch.no_grad():
            h = self.target.trunk(torch.cat([next_state, next_kappa, self.chain(next_state, next_kappa)], 1))
            targets = [signal + discount * alive * self.target.pessimistic(h, task)
                       for task, (signal, discount) in enumerate(zip((reward, cost, cost), DISCOUNTS))]
        h = self.critic.trunk(torch.cat([state, kappa, action], 1))
        leaf = h.detach().requires_grad_()
        trunk_gradients = []
        for heads, y in zip(self.critic.heads, targets):
            loss = sum(mse_loss(head(leaf), y) for head in heads)
            leaf.grad = None
            loss.backward()
            gradients = torch.autograd.grad(h, self.trunk, leaf.grad, retain_graph=len(trunk_gradients) < 2)
            trunk_gradients.append(torch.cat([gradient.flatten() for gradient in gradients]))
        surgery = self.project(trunk_gradients).split([p.numel() for p in self.trunk])
        for parameter, gradient in zip(self.trunk, surgery):
            parameter.grad = gradient.view_as(parameter)
        self.critic_adam.step()
        self.critic_adam.zero_grad()

    def project(self, gradients):
        """PCGrad (Eq. 5)."""
        projected = []
        for i, own in enumerate(gradients):
            for j in (j for j in range(3) if j != i):
                inner = own @ gradients[j]
                if inner < 0:
                    own = own - inner / (gradients[j] @ gradients[j]) * gradients[j]
            projected.append(own)
        return sum(projected) / 3

    def update_actor(self, state, kappa, action, weight):
        """Eqs. 11 to 16."""
        levels = torch.randint(1, LEVELS + 1, (BATCH,))
        noise = torch.randn_like(action)
        abar = self.alpha_bars[levels][:, None]
        context = self.actor.context(state, kappa)
        predicted = self.actor(abar.sqrt() * action + (1 - abar).sqrt() * noise, context, levels)
        cloning = (weight[:, 0] * (predicted - noise).square().sum(1)).mean()

        self.critic.requires_grad_(False)
        policy = self.chain(state, kappa)
        h = self.critic.trunk(torch.cat([state, kappa, policy], 1))
        reward, cost = self.critic.pessimistic(h, 0), self.critic.pessimistic(h, 1)
        lambdas = self.dual(kappa).clamp(-20, 5).exp()
        violation = cost - kappa
        actor_loss = cloning - ETA * reward.mean() + (lambdas.detach() * violation).mean()
        dual_loss = -(lambdas * violation.detach()).mean()
        actor_loss.backward()
        dual_loss.backward()
        self.critic.requires_grad_(True)
        for optimiser in (self.actor_adam, self.dual_adam):
            optimiser.step()
            optimiser.zero_grad()

    def step(self):
        rows = torch.randint(ROWS, (BATCH,))
        state, kappa, action, reward, cost, next_state, next_kappa, alive, weight = (x[rows] for x in self.data)
        self.update_critic(state, kappa, action, reward, cost, next_state, next_kappa, alive)
        self.update_actor(state, kappa, action, weight)
        with torch.no_grad():
            torch._foreach_lerp_(list(self.target.parameters()), list(self.critic.parameters()), TARGET_RATE)


def main():
    torch.manual_seed(0)
    torch.set_num_threads(int(os.environ["OMP_NUM_THREADS"]))
    learner = Learner()
    for line in sys.stdin:
        request, count = line.split()
        assert request == "steps"
        for _ in itertools.repeat(None, int(count)):
            learner.step()
        print(torch.__version__, flush=True)


if __name__ == "__main__":
    main()
