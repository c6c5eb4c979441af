"""Colours (red, green, blue) in the language of the paper's Figs. 8, 10 and 12."""

from __future__ import annotations

Colour = tuple[int, int, int]

# the page
PAGE: Colour = (248, 248, 246)
FLOOR: Colour = (255, 255, 255)
INK: Colour = (33, 37, 43)
MUTED: Colour = (104, 111, 121)
RULE: Colour = (216, 219, 223)

# what the model of the future says
ICS: Colour = (199, 203, 210)
UNSEEN: Colour = (238, 231, 218)
UNSEEN_HATCH: Colour = (216, 204, 182)

# the tree and the choice
UNSAFE: Colour = (112, 212, 234)
SAFE: Colour = (52, 98, 222)
BRAKING: Colour = (214, 48, 196)
PARTICLE: Colour = (228, 66, 52)
CHOICE: Colour = (12, 158, 66)

# the world
STATIC: Colour = (84, 90, 100)
MOVER: Colour = (16, 18, 22)
TRAIL: Colour = (84, 190, 208)
ROBOT: Colour = (220, 38, 38)
ROBOT_PALE: Colour = (255, 222, 219)
EXECUTED: Colour = (170, 22, 32)
GOAL: Colour = (226, 32, 44)
CONTACT: Colour = (255, 150, 0)
