"""The command ``armor-plant``: fly a task's robot by a controller behind a link."""

import argparse
import json
import sys
from pathlib import Path
from typing import NoReturn

from armor_plant import flight, recording, report
from armor_plant.client import Client, ControllerError
from armor_plant.line import Line, Process, Socket
from armor_plant.plants import SimulatorMissingError, make
from armor_plant.tasks import TASKS, Task
from armor_plant.wander import Wanderer


def main() -> None:
    """Run the command of the process's arguments."""
    arguments = _parser().parse_args()
    try:
        _run(arguments)
    except (ControllerError, SimulatorMissingError, OSError, ValueError) as error:
        _fail(" ".join(str(error).split()))
    except KeyboardInterrupt:
        _fail("stopped")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="armor-plant",
        description="Fly a robot of Safety-Gymnasium or Bullet-Safety-Gym "
        "by a controller behind a link.",
    )
    add = parser.add_argument
    add("task", choices=sorted(TASKS), metavar="TASK", help="one of " + ", ".join(sorted(TASKS)))
    line = parser.add_mutually_exclusive_group(required=True)
    line.add_argument(
        "--connect", metavar="HOST:PORT", help="where firmware-sim serve --listen waits"
    )
    line.add_argument(
        "--serve-command",
        metavar="COMMAND",
        help="a command that serves on its standard streams, as 'firmware-sim serve IMAGE --stdio'",
    )
    line.add_argument(
        "--wander",
        action="store_true",
        help="no controller: smooth random actions, to record what a plant does",
    )
    add("--limit", type=float, metavar="D", help="cost that an episode may incur (the paper's)")
    add("--episodes", type=_count, default=20, help="episodes to fly (20)")
    add("--steps", type=_count, metavar="N", help="steps of an episode (the task's horizon)")
    add("--first", type=_natural, default=0, help="number of the first of them (0)")
    add("--seed", type=_natural, default=0, help="decides the starts and the noise (0)")
    add("--patience", type=float, default=10.0, help="seconds to wait for an answer (10)")
    add("--record", type=Path, metavar="FILE.hdf5", help="write what was flown as a DSRL file")
    add("--each", action="store_true", help="print a line of JSON for each episode")
    add("--json", action="store_true", help="print one JSON object as the last line of stdout")
    return parser


def _run(arguments: argparse.Namespace) -> None:
    if arguments.record and not arguments.record.absolute().parent.is_dir():
        raise ValueError(f"{arguments.record} lies in no folder; make the folder first")
    plant = make(arguments.task)
    task = plant.task
    steps = task.horizon if arguments.steps is None else min(arguments.steps, task.horizon)
    limit = task.cost_limit if arguments.limit is None else arguments.limit
    if not 0 <= limit < 65536:
        raise ValueError("a cost limit is a number from 0 to below 65536")
    client = _controller(arguments, task)
    episodes = []
    for number in range(arguments.first, arguments.first + arguments.episodes):
        seeds = flight.Seeds.of(arguments.seed, number)
        episode = flight.fly(plant, client, limit, seeds, steps)
        episodes.append(episode)
        if arguments.each:
            print(_episode_json(number, episode), flush=True)
    client.close()
    if arguments.record:
        recording.write(arguments.record, episodes)
    scores = report.summary(task, limit, arguments.seed, episodes)
    if arguments.json:
        print(report.text(scores), file=sys.stderr)
        print(json.dumps(scores))
    else:
        print(report.text(scores))


def _controller(arguments: argparse.Namespace, task: Task) -> flight.Controller:
    if arguments.wander:
        return Wanderer(task)
    client = Client(_line(arguments), arguments.patience)
    _check_policy(client, task)
    return client


def _line(arguments: argparse.Namespace) -> Line:
    if arguments.connect is not None:
        return Socket(arguments.connect, arguments.patience)
    return Process(arguments.serve_command)


def _check_policy(client: Client, task: Task) -> None:
    policy = client.identity
    if (policy.state, policy.action) != (task.state, task.action):
        raise ControllerError(
            f"the policy ({policy.task}) senses {policy.state} and moves {policy.action} entries, "
            f"{task.name} has {task.state} and {task.action}; serve an image for this task"
        )


def _episode_json(number: int, episode: flight.Episode) -> str:
    return json.dumps(
        {
            "episode": number,
            "rewards": episode.rewards,
            "costs": episode.costs,
            "goals": episode.goals,
        }
    )


def _natural(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text} is no whole number from 0")
    return int(text)


def _count(text: str) -> int:
    if _natural(text) == 0:
        raise argparse.ArgumentTypeError("at least one")
    return int(text)


def _fail(message: str) -> NoReturn:
    print(f"error: {message}", file=sys.stderr)
    raise SystemExit(1)
