"""Everything that can be reproduced, by name, in the order of the page."""

from __future__ import annotations

from passpmp_ti.reproduce import (
    chairs,
    crowds,
    cycle_length,
    getting_there,
    object_speed,
    one_cycle,
    running_time,
    sampling,
    slip_cones,
    slip_memory,
    slip_products,
    slip_standing,
    swarm_size,
    traps,
    weights,
)
from passpmp_ti.reproduce.item import Item


def _chair(item: str, title: str, scenario: str, says: str, **how: bool) -> Item:
    run = chairs.runner(item, scenario, says, **how)
    return Item(title=title, paper=says + ".", run=run, tell=chairs.tell)


TABLES = {
    "table3": Item(
        title="Table III: weights of distance and time",
        paper="Best plans by six pairs of weights. From w_d = 0.3 on distance alone decides; with"
        " 0.2 the plan ends 4.5 m farther from the goal and takes 2.4 s less.",
        run=weights.run_one_goal, tell=weights.tell_one_goal,
    ),
    "table4": Item(
        title="Table IV: the best weights for different goals",
        paper="Eight goals, each with its best weights: the larger w_d, the smaller the loss of"
        " distance against the nearest plan.",
        run=weights.run_many_goals, tell=weights.tell_many_goals,
    ),
    "table5": Item(
        title="Table V: speed of objects and p-safe states",
        paper="Share of p-safe states around the robot for objects of 5 to 50 m/s.",
        run=object_speed.run, tell=object_speed.tell,
    ),
    "table6": Item(
        title="Table VI: length of the cycle, nodes and plan length",
        paper="A longer cycle grows a larger tree and a longer plan; after 4.5 s unsafe regions"
        " slow the growth; at 0.3 s the safety check does not end in time.",
        run=cycle_length.run, tell=cycle_length.tell,
    ),
    "table7": Item(
        title="Table VII: running time beside ISS",
        paper="29 ms for PASSPMP-PSO, 65 ms for ISS.",
        run=running_time.run, tell=running_time.tell,
    ),
}  # fmt: skip

FIGURES = {
    "fig8": Item(
        title="Fig. 8: one planning cycle",
        paper="The tree, the particles and the optimum in the scene of Fig. 6; all particles lie"
        " outside the braking ICS.",
        run=one_cycle.run_cycle, tell=one_cycle.tell_cycle,
    ),
    "fig9": Item(
        title="Fig. 9: iterations of the optimisation",
        paper="Snapshots of the particles and of the global best over the iterations.",
        run=one_cycle.run_iterations, tell=one_cycle.tell_iterations,
    ),
    "fig10": Item(
        title="Fig. 10: planning cycles",
        paper="Cycle after cycle of 2.4 s to the goal in the scene of Fig. 6, always out of the"
        " braking ICS.",
        run=crowds.run_simple, tell=crowds.tell_simple,
    ),
    "fig12": Item(
        title="Fig. 12: among 22 moving objects",
        paper="The drive through the crowd of Fig. 11 with cycles of 1.4 s.",
        run=crowds.run_crowded, tell=crowds.tell_crowded,
    ),
    "fig13": Item(
        title="Fig. 13: swarm sizes",
        paper="Below 20 particles the optimum may be missed; from 20 on 100 of 100 runs find it.",
        run=swarm_size.run, tell=swarm_size.tell,
    ),
    "fig14": Item(
        title="Fig. 14: PASSPMP-PSO and PASSPMP at the U",
        paper="PASSPMP-PSO leaves the concave region, PASSPMP stands in it; both are p-safe.",
        run=traps.run_minimum, tell=traps.tell_minimum,
    ),
    "fig15": Item(
        title="Fig. 15: ISS in the crowd",
        paper="A motion that is free of all that is seen ends in a collision with a moving object.",
        run=sampling.run, tell=sampling.tell,
    ),
    "fig16": Item(
        title="Fig. 16: ISS in the U, without a way out",
        paper="ISS takes the motion nearest to the goal until none is free any more.",
        run=traps.run_no_way_out, tell=traps.tell_no_way_out,
    ),
    "fig17": Item(
        title="Fig. 17: ISS in the U, for ever",
        paper="ISS finds free motions and stays in the concave region.",
        run=traps.run_for_ever, tell=traps.tell_for_ever,
    ),
}  # fmt: skip

EXPERIMENTS = {
    "fig19": _chair(
        "fig19", "Fig. 19: a narrow passage outdoors", "narrow_passage",
        "The wheelchair passes between two obstacles to its goal", reaches=True,
    ),
    "fig20": _chair(
        "fig20", "Fig. 20: a corridor", "corridor",
        "The wheelchair passes things that stand in a corridor and reaches its goal", reaches=True,
    ),
    "fig21": _chair(
        "fig21", "Fig. 21: a person in the corridor", "corridor_person",
        "The wheelchair stops for a pedestrian, stands, and goes on when the passage is free",
        reaches=True, waits=True,
    ),
    "fig22": _chair(
        "fig22", "Fig. 22: a dead end", "dead_end",
        "The wheelchair brakes and comes to rest where no safe way leads on", reaches=False,
    ),
}  # fmt: skip

GETTING_THERE = {
    "guide": Item(
        title="The guide against the straight distance",
        paper="The paper judges a plan by the straight distance of its last state (eq. 18).",
        run=getting_there.run_guides, tell=getting_there.tell_guides,
    ),
    "trees": Item(
        title="Deeper trees against better guidance",
        paper="Sec. 5.1.4 takes it that optimising over the tree leads out of the U.",
        run=getting_there.run_trees, tell=getting_there.tell_trees,
    ),
}  # fmt: skip

SLIPS = {
    "memory": Item(
        title="A model without memory loses its root",
        paper="Property 3 relies on what is p-safe staying so in the next cycle's model.",
        run=slip_memory.run, tell=slip_memory.tell,
    ),
    "products": Item(
        title="Products of probabilities give riskless plans",
        paper="Eqs. 9, 10, 12 and 17 multiply the chances of collisions, or take the least.",
        run=slip_products.run, tell=slip_products.tell,
    ),
    "standing": Item(
        title="Weights that make standing still the best",
        paper="Sec. 5.1.3 settles on w_t = 0.8 and w_d = 0.2.",
        run=slip_standing.run, tell=slip_standing.tell,
    ),
    "cones": Item(
        title="Cones that fill the view after 4 s",
        paper="Secs. 5.1.1 to 5.1.3: objects of 20 m/s, sight of 80 m, cycles of 1.4 and 2.4 s.",
        run=slip_cones.run, tell=slip_cones.tell,
    ),
}  # fmt: skip

GROUPS = {
    "The paper's tables": TABLES,
    "The paper's figures": FIGURES,
    "The paper's experiments": EXPERIMENTS,
    "Getting there": GETTING_THERE,
    "What the paper could not have claimed": SLIPS,
}
ITEMS: dict[str, Item] = {name: item for group in GROUPS.values() for name, item in group.items()}
