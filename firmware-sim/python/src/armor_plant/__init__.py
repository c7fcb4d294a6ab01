"""Robots of Safety-Gymnasium and Bullet-Safety-Gym, flown over the link.

The plant asks and the controller answers: ``docs/link.md`` of the project is
the protocol. A control step is a state and the cost of the step before in, a
bounded action out; the reward stays here.

====================  ========================================================
module                says
====================  ========================================================
``cobs``, ``postcard``  bytes of a frame, and of what is in it
``messages``          what is asked and answered
``line``, ``client``  a connection with patience; ask, and ask again
``tasks``             the 14 tasks, and what scores are normalised by
``repairs``, ``plants``  the simulators, mended; one interface for both
``flight``, ``report``  episodes and their scores
``wander``            random actions in place of a controller
``recording``         DSRL files of what was flown
``cli``               the command ``armor-plant``
====================  ========================================================
"""

from armor_plant.client import Client, ControllerError
from armor_plant.plants import Plant, make
from armor_plant.tasks import TASKS, Task

__all__ = ["TASKS", "Client", "ControllerError", "Plant", "Task", "make"]
