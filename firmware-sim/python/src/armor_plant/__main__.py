"""``python -m armor_plant`` is ``armor-plant``."""

from armor_plant.cli import main

main()
