"""One full training step of ARMOR in float64 by automatic differentiation: the numbers
that the hand-written gradients are tested against.

    python -m venv venv && venv/bin/pip install torch==2.2.2 numpy==1.26.4
    venv/bin/python step.py          # writes step.json beside itself (Python 3.11, CPU, one thread)

Written from the paper's equations (CMC 88(1):67, 2026), not from the Rust code. Before it writes,
the program checks its own gradients by finite differences, and that no value lies on a kink of
a clip, minimum, maximum or ReLU.

Layout. A matrix is a flat list in which a sample's entries are adjacent: [B,A] below means
sample by sample, [N,B,A] means N such matrices. The parameters of a network are one list, layer by
layer: the weight (out x in) input by input, then the bias.
  actor   kappa MLP, time MLP, denoiser of [noisy action; state; kappa code; time code]
  critic  trunk of [state; kappa_scale kappa; action], heads r1 r2 L1 L2 S1 S2
  dual    log lambda of kappa_scale kappa
Tasks are r, L, S = 0, 1, 2. The networks see kappa_scale kappa; Eqs. 8, 15 and 16 compare with kappa.

Keys (P_a, P_c, P_t, P_d = 1176, 1110, 264, 118: actor, critic, its trunk, dual).
  config                              object of sizes and constants
  alpha_bar [N+1]                     n = 0..N
Inputs
  actor [P_a]  critic, target_critic [P_c]  dual [P_d]
  s, s_next [B,S]  a [B,A]  r, c, kappa, kappa_next, done, w, w_traj [B]
  next_start_noise, pi_start_noise [B,A]   the chains' a^N
  next_step_noise, pi_step_noise [N-1,B,A] first added in the step N -> N-1; the last step adds none
  bc_n [B] (1..N)  bc_eps [B,A]
  perturbation [K,B,A]                standard normal, not yet times sigma
  pcgrad_order [6]                    the others of r, of L, of S, in the order of projection
Critic (Eqs. 3-5)
  a_next [B,A]  q_next [B,6] (target critic)  q [B,6]  y_r, y_l, y_s [B]  critic_losses [3]
  trunk_grads [3,P_t]  negative_pairs  trunk_grad [P_t]  critic_grad [P_c]  critic_after [P_c]
Actor (Eqs. 13, 15); updated critic, dual before its update
  bc_noised [B,A]  eps_hat [B,A]  l_bc  bc_grad [P_a]  lambda [B]
  full_x0 [N,B,A]                     estimates before the clip, n = N..1
  full_a_pi [B,A]  full_q_r, full_q_l [B]  full_loss  full_grad [P_a]  actor_after [P_a] (from full_grad)
  one_step_x0 [B,A] (before the clip)  one_step_a_pi [B,A]  one_step_q_r, one_step_q_l [B]
  one_step_loss  one_step_grad [P_a]
Dual (Eq. 16, with full_q_l)
  dual_loss  dual_grad [P_d]  dual_after [P_d]
  dual_after_three [P_d]              Adam on dual with dual_grad, then -dual_grad/2, then dual_grad/10
  clip_dual [P_d]                     dual with its last layer negated, for a second batch of 3:
  clip_kappa, clip_q_l [3]            the last one's log lambda is above its clip at 5
  clip_log_lambda (before the clip), clip_lambda [3]  clip_loss  clip_grad [P_d]
Target  target_after [P_c]
Weights (Eqs. 8-10, updated critic, the batch as the whole data)
  q_s_perturbed [K,B]  q_s_data [B]  m, w_cf_new, w_cf, weights [B]
Sampling  ddim_levels [3]  ddim_a [B,A] (from pi_start_noise, actor before its update)
"""

import json
import math
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F

torch.set_default_dtype(torch.float64)
torch.set_num_threads(1)

SEED = 3960  # found by search: its data meet every condition asserted below
S, A, B, N = 5, 2, 6, 5
CONFIG = dict(
    state=S, action=A, batch=B, steps=N, denoiser_hidden=16, kappa_widths=[1, 8, 8, 4], time_widths=[8, 12, 6],
    trunk_hidden=12, head_hidden=10, dual_widths=[1, 9, 9, 1], beta_min=0.1, beta_max=10.0, kappa_scale=0.2,
    gamma=[0.99, 0.99, 0.3], eta=1.0, adam_beta=[0.9, 0.999], adam_eps=1e-8, lr_critic=1e-3, lr_actor=1e-4,
    lr_dual=1e-4, tau=0.005, log_lambda=[-20.0, 5.0], pcgrad_guard=1e-12, perturbations=3, sigma=0.1, weight_eps=1e-6,
    ema=0.3, w_min=0.8, w_max=2.0, ddim_steps=3,
)
KAPPA_SCALE, K, H = CONFIG["kappa_scale"], CONFIG["perturbations"], CONFIG["denoiser_hidden"]
TASKS = R, L, C = 0, 1, 2  # reward, long-term cost, short-term cost
ORDER = {R: [L, C], L: [C, R], C: [R, L]}

# Each network as its list of (inputs, outputs), in the order of the flat vector.
pairs = lambda widths: list(zip(widths, widths[1:]))
CODE = S + A + CONFIG["kappa_widths"][-1] + CONFIG["time_widths"][-1]
ACTOR = pairs(CONFIG["kappa_widths"]) + pairs(CONFIG["time_widths"]) + pairs([CODE, H, H, H, A])
TRUNK = pairs([S + 1 + A, CONFIG["trunk_hidden"], CONFIG["trunk_hidden"]])
CRITIC = TRUNK + 6 * pairs([CONFIG["trunk_hidden"], CONFIG["head_hidden"], 1])
DUAL = pairs(CONFIG["dual_widths"])
size = lambda network: sum(i * o + o for i, o in network)
P_TRUNK = size(TRUNK)

ALPHA_BAR = [math.exp(-(CONFIG["beta_min"] * t + (CONFIG["beta_max"] - CONFIG["beta_min"]) * t * t / 2))
             for t in (n / N for n in range(N + 1))]


# ---- networks, as functions of their flat vector ----

def layers(network, flat):
    """The (weight, bias) of every layer; the flat weight is input by input."""
    assert flat.numel() == size(network)
    at, out = 0, []
    for i, o in network:
        weight = flat[at:at + i * o].reshape(i, o).T
        out.append((weight, flat[at + i * o:at + i * o + o]))
        at += i * o + o
    return out


def mlp(x, parts, hidden, last):
    for k, (weight, bias) in enumerate(parts):
        x = F.linear(x, weight, bias)
        x = last(x) if k + 1 == len(parts) else hidden(x)
    return x


linear = lambda x: x


def time_code(n):
    half = CONFIG["time_widths"][0] // 2
    frequencies = torch.exp(-torch.arange(half) * math.log(10000.0) / (half - 1))
    argument = (n - 1.0)[:, None] * frequencies
    return torch.cat([argument.sin(), argument.cos()], 1)


def eps_hat(actor, noisy, state, kappa, n):
    parts = layers(ACTOR, actor)
    e_kappa = mlp(KAPPA_SCALE * kappa[:, None], parts[:3], F.mish, linear)
    e_time = mlp(time_code(n), parts[3:5], F.mish, linear)
    return mlp(torch.cat([noisy, state, e_kappa, e_time], 1), parts[5:], F.mish, linear)


def critic_q(critic, state, kappa, action):
    """[B, 6]: r1 r2 L1 L2 S1 S2."""
    parts = layers(CRITIC, critic)
    h = mlp(torch.cat([state, KAPPA_SCALE * kappa[:, None], action], 1), parts[:2], F.mish, F.mish)
    return torch.cat([mlp(h, parts[2 + 2 * i:4 + 2 * i], F.mish, linear) for i in range(6)], 1)


def log_lambda(dual, kappa):
    return mlp(KAPPA_SCALE * kappa[:, None], layers(DUAL, dual), F.relu, linear)[:, 0]


def lambda_of(dual, kappa):
    return torch.exp(torch.clamp(log_lambda(dual, kappa), *CONFIG["log_lambda"]))


lowest = lambda q, task: q[:, 2 * task:2 * task + 2].min(1).values
highest = lambda q, task: q[:, 2 * task:2 * task + 2].max(1).values


# ---- samplers (Eq. 12) ----

def estimate(a, eps, abar):
    """x0 before the clip; abar a number or [B, 1]."""
    return (a - (1 - abar) ** 0.5 * eps) / abar ** 0.5


def ddpm(actor, state, kappa, start, noise):
    """The action and the unclipped estimates of every step."""
    a, estimates = start, []
    for i, n in enumerate(range(N, 0, -1)):
        abar, before = ALPHA_BAR[n], ALPHA_BAR[n - 1]
        alpha = abar / before
        beta = 1 - alpha
        x0 = estimate(a, eps_hat(actor, a, state, kappa, torch.full((B,), float(n))), abar)
        estimates.append(x0)
        a = (beta * before ** 0.5 * torch.clamp(x0, -1, 1) + (1 - before) * alpha ** 0.5 * a) / (1 - abar)
        if n > 1:
            a = a + (beta * (1 - before) / (1 - abar)) ** 0.5 * noise[i]
    return a, torch.stack(estimates)


def ddim(actor, state, kappa, start):
    m = CONFIG["ddim_steps"]
    levels = [-(-i * N // m) for i in range(m, -1, -1)]
    a, estimates = start, []
    for n, to in zip(levels, levels[1:]):
        x0 = estimate(a, eps_hat(actor, a, state, kappa, torch.full((B,), float(n))), ALPHA_BAR[n])
        estimates.append(x0)
        x0 = torch.clamp(x0, -1, 1)
        eps = (a - ALPHA_BAR[n] ** 0.5 * x0) / (1 - ALPHA_BAR[n]) ** 0.5
        a = ALPHA_BAR[to] ** 0.5 * x0 + (1 - ALPHA_BAR[to]) ** 0.5 * eps
    return a, levels[:-1], torch.stack(estimates)


# ---- helpers ----

def gradient(loss, flat):
    """loss(flat) and its gradient, the latter checked by central differences at the largest and at spread entries."""
    x = flat.clone().requires_grad_()
    value = loss(x)
    (g,) = torch.autograd.grad(value, x)
    step = 1e-6
    for k in {int(g.abs().argmax()), *range(0, len(flat), len(flat) // 12)}:
        shift = torch.zeros_like(flat)
        shift[k] = step
        numeric = (loss(flat + shift) - loss(flat - shift)) / (2 * step)
        assert abs(numeric - g[k]) <= 1e-7 * (1 + value.abs() + g[k].abs()), (k, numeric.item(), g[k].item())
    return value.detach(), g


def adam(flat, gradients, lr):
    p = torch.nn.Parameter(flat.clone())
    optimiser = torch.optim.Adam([p], lr=lr, betas=CONFIG["adam_beta"], eps=CONFIG["adam_eps"])
    for g in gradients:
        p.grad = g.clone()
        optimiser.step()
    return p.detach()


def off_kink(name, distance, least=1e-3):
    assert distance.abs().min() > least, (name, distance.abs().min().item())


def both(name, mask):
    assert mask.any() and not mask.all(), name


def inputs(seed):
    random = np.random.RandomState(seed)
    tensor = lambda x: torch.tensor(np.asarray(x, dtype=np.float64))
    normal = lambda *shape: tensor(random.randn(*shape))

    def parameters(network, gain):
        flat = []
        for i, o in network:
            flat += [random.uniform(-1, 1, i * o) * gain / i ** 0.5, random.uniform(-1, 1, o) * 0.2]
        return tensor(np.concatenate(flat))

    d = dict(actor=parameters(ACTOR, 1.7), critic=parameters(CRITIC, 2.5), target_critic=parameters(CRITIC, 2.5),
             dual=parameters(DUAL, 1.7))
    # A critic sensitive to the action, so that small perturbations cross the threshold.
    first = TRUNK[0][1]
    d["critic"][(S + 1) * first:(S + 1 + A) * first] *= 4
    d.update(
        s=0.5 * normal(B, S), a=tensor(random.uniform(-1, 1, (B, A))), r=normal(B), c=tensor([0, 1, 0, 0.5, 1, 0]),
        kappa=tensor([0, 1, 0, 0.5, 3, 0.25]), s_next=0.5 * normal(B, S), done=tensor([0, 1, 0, 1, 0, 0]),
        w=tensor(random.uniform(0.8, 2, B)), w_traj=tensor([1.5, 1, 1.5, 1, 1, 1]),
        next_start_noise=normal(B, A), next_step_noise=normal(N - 1, B, A),
        pi_start_noise=normal(B, A), pi_step_noise=normal(N - 1, B, A),
        bc_n=tensor([1, 2, 3, 4, 5, 2]), bc_eps=normal(B, A), perturbation=normal(K, B, A),
    )
    d["kappa_next"] = d["kappa"] - d["c"]
    return d


# ---- one step ----

def critic_step(d):
    with torch.no_grad():
        d["a_next"], x0 = ddpm(d["actor"], d["s_next"], d["kappa_next"], d["next_start_noise"], d["next_step_noise"])
        q_next = d["q_next"] = critic_q(d["target_critic"], d["s_next"], d["kappa_next"], d["a_next"])
        d["q"] = critic_q(d["critic"], d["s"], d["kappa"], d["a"])
    off_kink("next x0", x0.abs() - 1)
    both("next actions clipped", x0[-1].abs() > 1)
    off_kink("target twins", q_next[:, ::2] - q_next[:, 1::2])
    future = [lowest(q_next, R), highest(q_next, L), highest(q_next, C)]
    targets = [x + g * (1 - d["done"]) * f for x, g, f in zip([d["r"], d["c"], d["c"]], CONFIG["gamma"], future)]
    d["y_r"], d["y_l"], d["y_s"] = targets

    def loss(task):
        def of(critic):
            q = critic_q(critic, d["s"], d["kappa"], d["a"])[:, 2 * task:2 * task + 2]
            return ((q - targets[task][:, None]) ** 2).sum(1).mean()
        return of

    losses, full = zip(*(gradient(loss(task), d["critic"]) for task in TASKS))
    g = [x[:P_TRUNK] for x in full]
    d["critic_losses"], d["trunk_grads"] = torch.stack(losses), torch.stack(g)
    cosines = [F.cosine_similarity(g[i], g[j], dim=0) for i, j in [(R, L), (R, C), (L, C)]]
    d["negative_pairs"] = sum(int(x < 0) for x in cosines)
    assert d["negative_pairs"] == 2, "two pairs, so that the order of projection matters"
    projected = []
    for i in TASKS:
        p = g[i].clone()
        for j in ORDER[i]:
            off_kink("pcgrad", F.cosine_similarity(p, g[j], dim=0), 3e-3)
            if p @ g[j] < 0 and g[j] @ g[j] >= CONFIG["pcgrad_guard"]:
                p = p - (p @ g[j]) / (g[j] @ g[j]) * g[j]
        projected.append(p)
    d["trunk_grad"] = torch.stack(projected).mean(0)
    # A head has a gradient from its own task only, so the sum over tasks is the head's ordinary gradient.
    d["critic_grad"] = torch.cat([d["trunk_grad"], sum(full)[P_TRUNK:]])
    d["critic_after"] = adam(d["critic"], [d["critic_grad"]], CONFIG["lr_critic"])


def actor_step(d):
    abar = torch.tensor(ALPHA_BAR)[d["bc_n"].long()][:, None]
    noised = d["bc_noised"] = abar ** 0.5 * d["a"] + (1 - abar) ** 0.5 * d["bc_eps"]
    d["lambda"] = lambda_of(d["dual"], d["kappa"])
    predict = lambda actor: eps_hat(actor, noised, d["s"], d["kappa"], d["bc_n"])
    bc = lambda eps: (d["w"] * ((eps - d["bc_eps"]) ** 2).sum(1)).mean()

    def value(a_pi):
        q = critic_q(d["critic_after"], d["s"], d["kappa"], a_pi)
        return lowest(q, R), highest(q, L), q

    def guided(a_pi):
        q_r, q_l, _ = value(a_pi)
        return -CONFIG["eta"] * q_r.mean() + (d["lambda"] * (q_l - d["kappa"])).mean()

    chain = lambda actor: ddpm(actor, d["s"], d["kappa"], d["pi_start_noise"], d["pi_step_noise"])
    one_step = lambda eps: estimate(noised, eps, abar)
    d["eps_hat"] = predict(d["actor"])
    d["l_bc"], d["bc_grad"] = gradient(lambda actor: bc(predict(actor)), d["actor"])

    def full_loss(actor):
        return bc(predict(actor)) + guided(chain(actor)[0])

    def one_step_loss(actor):
        eps = predict(actor)
        return bc(eps) + guided(torch.clamp(one_step(eps), -1, 1))

    d["full_a_pi"], d["full_x0"] = chain(d["actor"])
    d["one_step_x0"] = one_step(d["eps_hat"])
    d["one_step_a_pi"] = torch.clamp(d["one_step_x0"], -1, 1)
    twins = []
    for name, loss in [("full", full_loss), ("one_step", one_step_loss)]:
        q_r, q_l, q = value(d[name + "_a_pi"])
        d[name + "_q_r"], d[name + "_q_l"] = q_r, q_l
        d[name + "_loss"], d[name + "_grad"] = gradient(loss, d["actor"])
        off_kink(name + " twins", q[:, ::2] - q[:, 1::2])
        off_kink(name + " x0", d[name + "_x0"].abs() - 1)
        twins.append(q)
    q = torch.cat(twins)
    both("first reward twin lower", q[:, 0] < q[:, 1])
    both("first cost twin higher", q[:, 2] > q[:, 3])
    for x0 in [d["one_step_x0"], *d["full_x0"][1:]]:
        both("x0 clipped", x0.abs() > 1)
    both("constraint violated", d["full_q_l"] > d["kappa"])
    d["actor_after"] = adam(d["actor"], [d["full_grad"]], CONFIG["lr_actor"])


def dual_step(d):
    def loss(kappa, q_l):
        return lambda dual: -(lambda_of(dual, kappa) * (q_l - kappa)).mean()

    d["dual_loss"], g = gradient(loss(d["kappa"], d["full_q_l"]), d["dual"])
    d["dual_grad"] = g
    d["dual_after"] = adam(d["dual"], [g], CONFIG["lr_dual"])
    # One step from zero moments does not show Adam's betas; three with changing gradients do.
    d["dual_after_three"] = adam(d["dual"], [g, -g / 2, g / 10], CONFIG["lr_dual"])

    last = DUAL[-1][0] + 1
    d["clip_dual"] = torch.cat([d["dual"][:-last], -d["dual"][-last:]])
    d["clip_kappa"], d["clip_q_l"] = torch.tensor([0.0, 1.0, 1000.0]), torch.tensor([0.5, 0.25, 1000.5])
    z = d["clip_log_lambda"] = log_lambda(d["clip_dual"], d["clip_kappa"])
    d["clip_lambda"] = lambda_of(d["clip_dual"], d["clip_kappa"])
    d["clip_loss"], d["clip_grad"] = gradient(loss(d["clip_kappa"], d["clip_q_l"]), d["clip_dual"])
    assert z[2] > CONFIG["log_lambda"][1] + 1, "log lambda above its clip"
    assert (log_lambda(d["dual"], d["kappa"]).abs() < 3).all(), "log lambda inside its clip"
    for kappa in [d["kappa"], d["clip_kappa"]]:
        x = KAPPA_SCALE * kappa[:, None]
        for weight, bias in layers(DUAL, d["dual"])[:-1]:
            x = F.linear(x, weight, bias)
            off_kink("relu", x)
            x = F.relu(x)


def weights(d):
    q_s = lambda a: highest(critic_q(d["critic_after"], d["s"], d["kappa"], a), C)
    moved = d["a"] + CONFIG["sigma"] * d["perturbation"]
    off_kink("perturbed action", moved.abs() - 1)
    both("perturbed action clipped", moved.abs() > 1)
    d["q_s_perturbed"] = torch.stack([q_s(torch.clamp(x, -1, 1)) for x in moved])
    d["q_s_data"] = q_s(d["a"])
    worst, safe = d["q_s_perturbed"].max(0).values, d["q_s_data"] <= d["kappa"]
    m = d["m"] = torch.relu(worst - d["kappa"]) * safe
    ratio = 1 + m / (m.mean() + CONFIG["weight_eps"])
    d["w_cf_new"] = torch.clamp(ratio, max=CONFIG["w_max"])
    d["w_cf"] = (1 - CONFIG["ema"]) * 1.0 + CONFIG["ema"] * d["w_cf_new"]
    u = d["w_traj"] * d["w_cf"]
    ratio_u = u / (u.mean() + CONFIG["weight_eps"])
    d["weights"] = torch.clamp(ratio_u, CONFIG["w_min"], CONFIG["w_max"])
    off_kink("margin", torch.cat([worst - d["kappa"], d["q_s_data"] - d["kappa"]]))
    off_kink("weight", torch.cat([ratio - CONFIG["w_max"], ratio_u - CONFIG["w_min"], ratio_u - CONFIG["w_max"]]))
    both("observed action safe", safe)
    assert ((worst > d["kappa"]) & ~safe).any() and (worst < d["kappa"]).any(), "both reasons for a zero margin"
    both("counterfactual weight capped", ratio[m > 0] > CONFIG["w_max"])
    both("final weight clipped", ratio_u < CONFIG["w_min"])


def run(seed):
    d = inputs(seed)
    critic_step(d)
    actor_step(d)
    dual_step(d)
    d["target_after"] = CONFIG["tau"] * d["critic_after"] + (1 - CONFIG["tau"]) * d["target_critic"]
    weights(d)
    d["ddim_a"], d["ddim_levels"], x0 = ddim(d["actor"], d["s"], d["kappa"], d["pi_start_noise"])
    off_kink("ddim x0", x0.abs() - 1)
    both("ddim clipped", x0[-1].abs() > 1)
    return d


if __name__ == "__main__":
    data = run(SEED)
    entries = {"config": CONFIG, "alpha_bar": ALPHA_BAR, "pcgrad_order": sum(ORDER.values(), [])}
    entries.update((k, v.flatten().tolist() if torch.is_tensor(v) and v.dim() else
                    v.item() if torch.is_tensor(v) else v) for k, v in data.items())
    text = ",\n".join(f"{json.dumps(k)}: {json.dumps(v)}" for k, v in entries.items())
    Path(__file__).with_name("step.json").write_text("{\n" + text + "\n}\n")
