"""What the simulators need before they run on this Python, and fast.

Nothing here changes an observation, a reward or a cost.
"""

import contextlib
import dataclasses
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

_SKYBOX = {
    "@name": "skybox",
    "@type": "skybox",
    "@builtin": "gradient",
    "@rgb1": "0.5 0.6 0.8",
    "@rgb2": "0 0 0",
    "@width": "32",
    "@height": "32",
}
"""A sky that MuJoCo draws itself, for one of 24 MB that it would decode at every reset."""


@contextlib.contextmanager
def array_defaults() -> Iterator[None]:
    """Let dataclasses have arrays as defaults, as Safety-Gymnasium's do.

    Python 3.11 refuses a default that cannot be hashed, Python 3.10 only lists,
    dicts and sets. The newer check is kept from seeing any other default.
    """
    module: Any = dataclasses
    check = module._get_field

    def get_field(cls: type, name: str, *rest: Any) -> Any:
        default = cls.__dict__.get(name, dataclasses.MISSING)
        if isinstance(default, (list, dict, set)) or type(default).__hash__ is not None:
            return check(cls, name, *rest)
        delattr(cls, name)
        field = check(cls, name, *rest)
        setattr(cls, name, default)
        field.default = default
        return field

    module._get_field = get_field
    try:
        yield
    finally:
        module._get_field = check


def plain_sky(world: Any) -> None:
    """Give the worlds of ``safety_gymnasium.world`` a sky that takes no time."""
    yaml = world.yaml

    def load(stream: Any, Loader: Any) -> Any:
        config = yaml.load(stream, Loader)
        config["textures"]["skybox"] = _SKYBOX
        return config

    world.yaml = SimpleNamespace(load=load, FullLoader=yaml.FullLoader)
